//! Frames that are lost, late, changed or imitated: hazards 1 to 6, 12 and 13.

use crate::common::prelude::*;
use crate::gateway::{Gateway, NODE};
use crate::inject::{ELEVATION, POSITION, WIRE_CUT, every};
use crate::reaction::Reaction;
use crate::rig::{Onset, Rig, Setup, cycles, millis};
use crate::script;
use crate::shaper::Shaper;
use faults::{Effect, FaultKind, Service, Target};

/// COB-ID of the elbow's position.
const ELBOW_POSITION: u16 = 0x183;

/// Heartbeats of the drives every 5 ms, which one bus hardly carries beside the positions of each: where
/// they are sent, they are the quicker watch.
const QUICK_HEARTBEATS: [(&str, &str); 3] = [
    ("drive_heartbeat_ms = 100", "drive_heartbeat_ms = 5"),
    ("drive_lost_ms = 250", "drive_lost_ms = 25"),
    ("load_limit_percent = 90", "load_limit_percent = 99"),
];

/// Injects a fault into a joint of an engaged arm, and checks the cause of the stop.
fn stopped_by(
    name: &str,
    reason: &str,
    span: Duration,
    joint: Joint,
    fault: FaultKind,
) -> Reaction {
    stopped_with(&Setup::default(), name, reason, span, (joint, fault))
}

fn stopped_with(
    setup: &Setup,
    name: &str,
    reason: &str,
    span: Duration,
    (joint, fault): (Joint, FaultKind),
) -> Reaction {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged(name, setup);
    let onset = rig.onset();
    rig.inject(&gateway, Target::Joint(joint), fault);
    rig.run_for(span);
    rig.is_stopped_by(reason);
    rig.seen_after(onset, span)
}

#[test]
fn hazard_01_broken_cable_of_a_drive_stops_all_in_five_cycles() {
    let reason = "joint 3 (elbow): no sample for 3 cycles";
    let seen = stopped_by("cable", reason, millis(20), ELBOW, WIRE_CUT);
    seen.all_are_free_within(cycles(5));
    seen.are_free_together();
}

#[test]
fn hazard_02_missing_heartbeat_switches_all_off_in_30_ms() {
    let setup = Setup { changes: QUICK_HEARTBEATS.to_vec(), ..Setup::default() };
    let fault = (ELBOW, every(Service::Heartbeat, Effect::Drop));
    let reason = "joint 3 (elbow): heartbeat lost";
    let seen = stopped_with(&setup, "heartbeat", reason, millis(60), fault);
    seen.all_are_free_within(millis(30));
    seen.are_free_together();
}

#[test]
fn hazard_03_missing_positions_stop_all_in_five_cycles() {
    let reason = "joint 3 (elbow): no sample for 3 cycles";
    let lost = every(POSITION, Effect::Drop);
    let seen = stopped_by("tpdo", reason, millis(20), ELBOW, lost);
    seen.all_are_free_within(cycles(5));
    seen.are_free_together();
}

/// Delays one joint's positions.
fn late(name: &str, delay: &str) -> (Rig, Onset, Shaper, Gateway) {
    let gateway = Gateway::at(NODE);
    let shaper = Shaper::with_delay(NODE, delay);
    let mut rig = Rig::engaged(name, &Setup::default());
    let onset = rig.onset();
    shaper.hold(ELBOW_POSITION);
    rig.run_for(millis(40));
    (rig, onset, shaper, gateway)
}

#[test]
fn hazard_04_position_late_by_a_cycle_is_used() {
    let (rig, onset, _shaper, _gateway) = late("late-1", "1.2ms");
    rig.is("engaged");
    rig.seen_after(onset, millis(60)).targets_are_within_bounds();
}

#[test]
fn hazard_04_positions_late_by_three_cycles_stop_all_in_five() {
    let (rig, onset, _shaper, _gateway) = late("late-3", "3.4ms");
    rig.is_stopped_by("joint 3");
    let seen = rig.seen_after(onset, millis(40));
    seen.all_are_free_within(cycles(5));
}

#[test]
fn hazard_05_frozen_position_under_torque_stops_all_in_600_ms() {
    let gateway = Gateway::at(NODE);
    let setup = Setup { entries: script::long_press(), ..Setup::default() };
    let mut rig = Rig::engaged("frozen", &setup);
    let onset = rig.onset();
    rig.inject(&gateway, Target::Joint(ELEVATION), every(POSITION, Effect::Freeze));
    rig.run_for(millis(620));
    rig.is_stopped_by("joint 2 (elevation): position frozen under torque");
    rig.seen_after(onset, millis(620)).all_are_free_within(millis(600));
}

#[test]
fn hazard_06_imitated_drive_stops_all_in_three_cycles() {
    let imitated = FaultKind::Imitation { by: ELEVATION, service: POSITION };
    let seen = stopped_by("imitated", "joint 3", millis(20), ELBOW, imitated);
    seen.all_are_free_within(cycles(3));
}

#[test]
fn hazard_12_inverted_bit_of_a_position_stops_all_in_two_cycles() {
    let reason = "joint 3 (elbow): position jumped";
    let inverted = every(POSITION, Effect::Corrupt([0, 0, 0x10, 0, 0, 0, 0, 0]));
    let seen = stopped_by("inverted", reason, millis(20), ELBOW, inverted);
    seen.from(|entry| entry.id == ELBOW_POSITION).all_are_free_within(cycles(2));
}

#[test]
fn hazard_13_drives_without_targets_stop_in_6_ms_and_then_all() {
    let reason = "emergency 8250h";
    let lost = every(Service::Rpdo(1), Effect::Drop);
    let seen = stopped_by("rpdo", reason, millis(20), Joint::of::<1>(), lost);
    let has_no_targets = |node: u16| node <= 3;
    seen.are_free_within(millis(6), has_no_targets);
    let reported = seen.from(|entry| matches!(entry.id, 0x681..=0x683));
    reported.are_free_within(cycles(2), |node| !has_no_targets(node));
}
