//! Frames that are lost, late, wrong or another's: rows 1 to 6, 12 and 13.

use std::time::Duration;

use crate::gateway::Gateway;
use crate::gateway::NODE;
use crate::gateway::Way;
use crate::rig::Onset;
use crate::rig::Rig;
use crate::rig::Setup;
use crate::rig::cycles;
use crate::rig::millis;
use crate::script;
use crate::seen::Seen;
use crate::shaper::Shaper;

/// The elbow: it carries, and its limit is far.
const ELBOW: u16 = 3;

/// Heartbeats of the drives every 5 ms, which one bus hardly carries beside the positions of each: where
/// those come, they are the quicker watch.
const QUICK_HEARTBEATS: [(&str, &str); 3] = [
    ("drive_heartbeat_ms = 100", "drive_heartbeat_ms = 5"),
    ("drive_lost_ms = 250", "drive_lost_ms = 25"),
    ("load_limit_percent = 90", "load_limit_percent = 99"),
];

/// Breaks something between an engaged node and its drives, and checks what the node says of it.
fn broken(name: &str, reason: &str, span: Duration, fault: impl Fn(&Gateway)) -> Seen {
    broken_with(&Setup::default(), name, reason, span, fault)
}

fn broken_with(
    setup: &Setup,
    name: &str,
    reason: &str,
    span: Duration,
    fault: impl Fn(&Gateway),
) -> Seen {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged(name, setup);
    let onset = rig.onset();
    fault(&gateway);
    rig.run_for(span);
    rig.is_stopped_by(reason);
    rig.seen_after(onset, span)
}

#[test]
fn hazard_01_a_drive_whose_cable_breaks_takes_the_torque_off_all_within_five_cycles() {
    let seen = broken("cable", "joint 3: no sample for 3 cycles", millis(20), |gateway| {
        gateway.lose_all_of(ELBOW);
    });
    seen.all_are_free_within(cycles(5));
    seen.are_free_together();
}

#[test]
fn hazard_02_a_heartbeat_that_stops_alone_switches_all_off_within_30_ms() {
    let setup = Setup { changes: QUICK_HEARTBEATS.to_vec(), ..Setup::default() };
    let reason = "joint 3: heartbeat lost";
    let seen = broken_with(&setup, "heartbeat", reason, millis(60), |gateway| {
        gateway.lose(Way::ToNode, 0x700 + ELBOW);
    });
    seen.all_are_free_within(millis(30));
    seen.are_free_together();
}

#[test]
fn hazard_03_positions_that_stop_alone_take_the_torque_off_all_within_five_cycles() {
    let seen = broken("tpdo", "joint 3: no sample for 3 cycles", millis(20), |gateway| {
        gateway.lose(Way::ToNode, 0x180 + ELBOW);
    });
    seen.all_are_free_within(cycles(5));
    seen.are_free_together();
}

/// What one joint's positions do that are late by so much.
fn late(name: &str, delay: &str) -> (Rig, Onset, Shaper, Gateway) {
    let gateway = Gateway::at(NODE);
    let shaper = Shaper::with_delay(NODE, delay);
    let mut rig = Rig::engaged(name, &Setup::default());
    let onset = rig.onset();
    shaper.hold(0x180 + ELBOW);
    rig.run_for(millis(40));
    (rig, onset, shaper, gateway)
}

#[test]
fn hazard_04_a_position_that_is_constantly_late_by_a_cycle_is_used_and_bounded() {
    let (rig, onset, _shaper, _gateway) = late("late-1", "1.2ms");
    rig.is("engaged");
    rig.seen_after(onset, millis(60)).told_within_bounds();
}

#[test]
fn hazard_04_positions_that_are_late_by_three_cycles_take_the_torque_off_within_five() {
    let (rig, onset, _shaper, _gateway) = late("late-3", "3.4ms");
    rig.is_stopped_by("joint 3");
    let seen = rig.seen_after(onset, millis(40));
    seen.all_are_free_within(cycles(5));
}

#[test]
fn hazard_05_a_position_that_freezes_under_torque_takes_the_torque_off_within_600_ms() {
    let gateway = Gateway::at(NODE);
    let setup = Setup { script: script::long_press(), ..Setup::default() };
    let mut rig = Rig::engaged("frozen", &setup);
    let onset = rig.onset();
    let payload: String =
        rig.next(0x182).iter().chain(&[0; 4]).map(|byte| format!("{byte:02X}")).collect();
    gateway.alter(Way::ToNode, 0x182, &format!("SET:D:0.0.{payload}"));
    rig.run_for(millis(620));
    rig.is_stopped_by("joint 2: its position stands still");
    rig.seen_after(onset, millis(620)).all_are_free_within(millis(600));
}

#[test]
fn hazard_06_a_drive_that_speaks_for_another_takes_the_torque_off_within_three_cycles() {
    let seen = broken("impersonated", "joint 3", millis(20), |gateway| {
        gateway.copy(Way::ToNode, 0x182, "SET:I:183.0.0000000000000000");
    });
    seen.all_are_free_within(cycles(3));
}

#[test]
fn hazard_12_a_bit_of_a_position_that_flips_takes_the_torque_off_within_two_cycles() {
    let seen = broken("flipped", "joint 3: its position jumped", millis(20), |gateway| {
        gateway.alter(Way::ToNode, 0x183, "XOR:D:0.0.0000100000000000");
    });
    seen.from(|entry| entry.id == 0x183).all_are_free_within(cycles(2));
}

#[test]
fn hazard_13_drives_that_hear_no_torque_take_it_off_within_6_ms_and_the_others_two_cycles_later() {
    let seen = broken("rpdo", "emergency 8250h", millis(20), |gateway| {
        gateway.lose(Way::ToDrives, 0x201);
    });
    let is_deaf = |node: u16| node <= 3;
    seen.are_free_within(millis(6), is_deaf);
    let told = seen.from(|entry| matches!(entry.id, 0x681..=0x683));
    told.are_free_within(cycles(2), |node| !is_deaf(node));
}
