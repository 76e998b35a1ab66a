//! A node that is killed or frozen at any instruction: hazards 27 and 28. All its frames stop together, as all come from
//! the cycle; the drives stop by themselves.

use std::time::Duration;

use nix::sys::signal::Signal;

use crate::common::log::Entry;
use crate::gateway::{Gateway, NODE};
use crate::rig::{Rig, Setup, millis};

/// Drives with heartbeat monitoring alone, and forces for which that is quick enough.
const HEARTBEAT_ONLY: [(&str, &str); 4] = [
    ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 0 "),
    ("max_force_n = 40.0 ", "max_force_n = 13.0 "),
    ("max_damping_ns_per_m = 75.0", "max_damping_ns_per_m = 30.0"),
    ("push = 0.5 ", "push = 0.1 "),
];

/// Ends or freezes the node in a number of runs, and prints the time until the slowest drive was torque-free.
fn gone(
    name: &str,
    signal: Signal,
    runs: usize,
    changes: &[(&'static str, &'static str)],
    most: Duration,
) {
    let _gateway = Gateway::at(NODE);
    let mut pushed: Vec<Duration> = Vec::new();
    for run in 0..runs {
        let setup = Setup { changes: changes.to_vec(), ..Setup::default() };
        // The phase within the cycle depends on the name.
        let mut rig = Rig::engaged(&format!("{name}-{run}"), &setup);
        let onset = rig.onset();
        rig.node.as_ref().unwrap().signal(signal);
        let seen = rig.seen_after(onset, most * 2);
        seen.all_are_free_within(most);
        pushed.push(seen.last_is_free_after());
    }
    pushed.sort();
    let (median, longest) = (pushed[runs / 2], pushed[runs - 1]);
    println!(
        "{signal} at {runs} phases, {name}: torque-free after {median:?} (median), {longest:?} (longest)"
    );
}

#[test]
fn hazard_27_drives_of_a_killed_node_are_torque_free_in_6_ms() {
    gone("rpdo-timer", Signal::SIGKILL, 20, &[], millis(6));
}

#[test]
fn hazard_27_heartbeat_alone_makes_drives_torque_free_in_25_ms() {
    gone("heartbeat-only", Signal::SIGKILL, 10, &HEARTBEAT_ONLY, millis(25));
}

#[test]
fn hazard_28_drives_of_a_frozen_node_are_torque_free_in_6_ms() {
    gone("frozen", Signal::SIGSTOP, 5, &[], millis(6));
}

#[test]
fn hazard_27_killed_node_started_again_waits_for_a_reset() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("latch", &Setup::default());
    let onset = rig.onset();
    rig.kill_node();
    rig.start_node();
    rig.ctl("--wait status").succeeds();
    rig.run_for(millis(300));
    rig.is("drives-off");
    rig.is_stopped_by("the last run did not end in order");
    assert_eq!(rig.ctl("arm").code, Some(1));
    let waited = rig.now();
    let status = rig.status();
    assert!(status["note"].as_str().unwrap().contains("did not end in order"), "{status}");
    rig.ctl("reset").succeeds();
    // The recorder updates the status.
    rig.run_for(millis(100));
    rig.is("ready");
    // After an orderly end, the next start need not wait.
    let (outcome, _) = rig.terminate_node();
    outcome.succeeds();
    rig.start_node();
    rig.ctl("--wait status").succeeds();
    rig.run_for(millis(100));
    rig.is("ready");
    let seen = rig.seen_after(onset, millis(5));
    seen.all_are_free_within(millis(6));
    let is_enabling = |entry: &&Entry| {
        (0x301..=0x306).contains(&entry.id) && entry.data.first().is_some_and(|low| low & 8 != 0)
    };
    let enabled = seen.since().find(is_enabling).unwrap();
    assert!(enabled.nanos > waited.0, "a drive was enabled before the reset");
}
