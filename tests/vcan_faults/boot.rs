//! Signals, requests and bus faults during a boot that withholds SYNC or heartbeat. Hazards 23 and 30.

use crate::common::log::NODES;
use crate::common::process::Process;
use crate::gateway::{Gateway, NODE};
use crate::host::KEEPS;
use crate::rig::{Rig, Setup, millis};
use canopen_tools::candump::Line;

/// Returns a boot in which the drives have just lost SYNC (`sync`) or the heartbeat of their master.
fn boot_that_withholds(name: &str, sync: bool) -> Rig {
    let mut rig = Rig::started(name, &Setup { changes: KEEPS.to_vec(), ..Setup::default() });
    let is_enabled = |line: &Line<'_>| {
        line.canopen().is_some_and(|(id, status)| id == 0x286 && status[0] & 0x6F == 0x27)
    };
    // The last drive is enabled before SYNC is withheld, and again before the heartbeat is.
    rig.until(is_enabled);
    if !sync {
        rig.until(|line| {
            line.canopen().is_some_and(|(id, code)| id == 0x686 && code[..2] == [0x50, 0x82])
        });
        rig.until(is_enabled);
    }
    rig.run_for(millis(30));
    rig
}

#[test]
fn promise_12_signal_ends_a_boot_without_sync_or_heartbeat() {
    let _gateway = Gateway::at(NODE);
    for (name, sync) in [("term-sync", true), ("term-heartbeat", false)] {
        let mut rig = boot_that_withholds(name, sync);
        let onset = rig.now();
        let (outcome, took) = rig.terminate_node();
        outcome.succeeds();
        assert!(took <= millis(1_000), "{name}: {took:?}");
        let seen = rig.seen_after(onset, millis(20));
        seen.log().ends_with_every_drive_off(NODES);
        let seen_sync = seen.since().any(|entry| entry.id == 0x080);
        assert!(seen_sync, "{name}: the drives are switched off in cycles");
    }
}

#[test]
fn hazard_30_boot_without_sync_or_heartbeat_grants_disarm() {
    let _gateway = Gateway::at(NODE);
    for (name, sync) in [("disarm-sync", true), ("disarm-heartbeat", false)] {
        let mut rig = boot_that_withholds(name, sync);
        let asked = rig.now();
        rig.ctl("disarm").succeeds();
        let answered = rig.now();
        assert!(answered.0 - asked.0 < 100_000_000, "{name}: {} ns", answered.0 - asked.0);
        // The boot continues, and arms nothing.
        assert_eq!(rig.status()["mode"], "boot", "{name}");
        rig.ctl("--wait status").succeeds();
        rig.run_for(millis(100));
        rig.is("ready");
        let seen = rig.seen_after(asked, millis(5));
        let withheld = if sync { 0x080 } else { 0x77F };
        let first = seen.since().find(|entry| entry.id == withheld).unwrap();
        assert!(first.nanos > answered.0, "{name}: granted while it is withheld");
    }
}

#[test]
fn hazard_23_bus_off_ends_a_boot_that_withholds_sync() {
    let _gateway = Gateway::at(NODE);
    let mut rig = boot_that_withholds("off-sync", true);
    Process::start("cansend", &[NODE, "20000040#0000000000000000"]).wait().succeeds();
    let outcome = rig.node.take().unwrap().wait();
    assert_eq!(outcome.code, Some(5), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("bus off"), "{}", outcome.stderr);
}
