//! The node's process: stopped, ended, started again. Hazards 17, 25, 28 and 30. A busy processor (29) cannot be
//! tested in virtual time, where computing takes none.

use crate::common::log::NODES;
use crate::common::process::Process;
use crate::gateway::{Gateway, NODE};
use crate::inject::STOPPED;
use crate::rig::{Rig, Setup, cycles, millis};
use faults::Target;

/// Drives that keep their torque for 200 ms without their master, and a force that may be kept so long.
pub(crate) const KEEPS: [(&str, &str); 7] = [
    ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 200 "),
    ("node_lost_ms = 22 ", "node_lost_ms = 200 "),
    ("max_force_n = 40.0 ", "max_force_n = 2.0 "),
    ("centring_n = [2.0, 2.0, 2.0]", "centring_n = [0.0, 0.0, 0.0]"),
    ("damping_ns_per_m = [8.0, 8.0, 8.0]", "damping_ns_per_m = [4.0, 4.0, 4.0]"),
    ("max_damping_ns_per_m = 75.0", "max_damping_ns_per_m = 0.5"),
    ("push = 0.5 ", "push = 0.0 "),
];

#[test]
fn hazard_17_node_that_starts_switches_enabled_drives_off_first() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("restart", &Setup { changes: KEEPS.to_vec(), ..Setup::default() });
    let onset = rig.onset();
    rig.kill_node();
    rig.start_node();
    rig.run_for(millis(900));
    let seen = rig.seen_after(onset, millis(900));
    seen.all_are_free_within(millis(100));
    let start = seen.since().find(|entry| entry.id == 0 && entry.data.first() == Some(&1));
    let started = start.map_or(u64::MAX, |entry| entry.nanos);
    for node in NODES.filter(|node| seen.pushed(*node)) {
        let first =
            seen.first_controlword(node).unwrap_or_else(|| panic!("node {node}: no controlword"));
        assert_eq!(first.word & 0x8F, 0, "node {node}: the first controlword disables voltage");
        assert!(first.nanos < started, "node {node} was started before");
    }
    // It waits until the arm has been at rest for half a second.
    assert!(started > seen.onset() + crate::rig::nanos(millis(500)));
}

#[test]
fn hazard_28_resumed_node_sends_zero_without_a_burst() {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("stopped", &Setup::default());
    rig.inject(&gateway, Target::Host, STOPPED);
    let onset = rig.now();
    rig.run_for(millis(50));
    rig.resume_node();
    let resumed = rig.now();
    // The deadman closes again within this.
    rig.run_for(millis(450));
    rig.is_stopped();
    let seen = rig.seen_after(onset, millis(510));
    seen.all_are_free_within(millis(6));
    seen.goes_on_without_a_burst(resumed);
}

#[test]
fn hazard_25_backlog_of_a_stopped_node_is_discarded() {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("backlog", &Setup::default());
    rig.inject(&gateway, Target::Host, STOPPED);
    let onset = rig.now();
    // More than the socket's buffer holds.
    let flood = format!("{NODE} -g 0.1 -i -n 480 -I 7A0 -L 8 -D 0011223344556677");
    Process::start("cangen", &flood.split(' ').collect::<Vec<_>>()).wait().succeeds();
    rig.resume_node();
    let resumed = rig.now();
    rig.run_for(millis(30));
    rig.is_stopped();
    let seen = rig.seen_after(onset, millis(90));
    seen.all_are_free_within(millis(6));
    seen.goes_on_without_a_burst(resumed);
}

#[test]
fn hazard_30_terminated_node_has_every_drive_off_in_a_second() {
    let _gateway = Gateway::at(NODE);
    let in_the_wall = ("start_m = [0.4, 0.0, 0.3] ", "start_m = [0.552, 0.0, 0.3] ");
    let mut rig = Rig::engaged("end", &Setup { changes: vec![in_the_wall], ..Setup::default() });
    let status = rig.status();
    let felt = status["status"].to_string();
    let onset = rig.onset();
    let (outcome, took) = rig.terminate_node();
    outcome.succeeds();
    assert!(took <= millis(1_000), "{took:?}; {felt}");
    let seen = rig.seen_after(onset, millis(5));
    // A ramp of 50 ms, and the drives' time to zero.
    seen.all_are_free_within(millis(50) + cycles(2));
    seen.log().ends_with_every_drive_off(NODES);
}
