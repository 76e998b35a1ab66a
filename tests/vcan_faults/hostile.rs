//! Frames of somebody who does not belong on the bus: row 26.

use crate::common::process::Process;
use crate::gateway::Gateway;
use crate::gateway::NODE;
use crate::interface::Interface;
use crate::rig::Rig;
use crate::rig::Setup;
use crate::rig::cycles;
use crate::rig::millis;

/// An interface of the node's that takes CAN FD, as cangen wants it to.
const OPEN: &str = "vcan2";

/// Frames that no CANopen node takes for its own, whatever their identifier: 29 bits, remote, CAN FD.
const NOT_CANOPEN: [&str; 3] = ["-e -I 183 -L 4", "-R -I 183 -L 4", "-f -I 183 -L 4"];

/// Five frames a millisecond, so many in all; identifiers and data are those of `words`.
fn flood(words: &str, count: u32) -> Process {
    let words = format!("{OPEN} -g 0.2 -i -n {count} {words}");
    Process::of("cangen", &words.split(' ').collect::<Vec<_>>())
}

#[test]
fn hazard_26_frames_that_are_not_canopens_change_nothing() {
    let _interface = Interface::vcan(OPEN);
    let gateway = Gateway::at(OPEN);
    let mut rig = Rig::engaged("not-canopen", &Setup { node: OPEN, ..Setup::default() });
    let before = rig.status()["status"]["missing_samples"].clone();
    for words in NOT_CANOPEN {
        flood(words, 200).wait().succeeds();
    }
    rig.run_for(millis(5));
    let after = rig.status();
    assert!(matches!(after["mode"].as_str(), Some("engaged" | "armed")), "{after}");
    assert_eq!(after["status"]["missing_samples"], before);
    gateway.is_gone();
}

#[test]
fn hazard_26_another_masters_sync_or_nmt_switches_all_off_within_two_cycles() {
    let _gateway = Gateway::at(NODE);
    for (name, frame) in [("sync", "080#"), ("nmt", "000#0103")] {
        let mut rig = Rig::engaged(name, &Setup::default());
        let onset = rig.onset();
        Process::of("cansend", &[NODE, frame]).wait().succeeds();
        rig.run_for(millis(10));
        rig.is_stopped_by("another master");
        let seen = rig.seen_after(onset, millis(20));
        seen.all_are_free_within(cycles(2));
        seen.all_are_switched_off();
    }
}

#[test]
fn hazard_26_a_flood_of_anything_never_ends_the_node_nor_its_bounds() {
    let _interface = Interface::vcan(OPEN);
    let gateway = Gateway::at(OPEN);
    let mut rig = Rig::engaged("flood", &Setup { node: OPEN, ..Setup::default() });
    let onset = rig.onset();
    flood("-m -I r -L r -D r", 300).wait().succeeds();
    flood("-I 000 -L r -D r", 50).wait().succeeds();
    rig.run_for(millis(10));
    rig.is_stopped();
    let seen = rig.seen_after(onset, millis(100));
    seen.told_within_bounds();
    gateway.is_gone();
}
