//! Adapters and cables: hazards 22 to 24. Frames may be accepted and reach no device.

use crate::common::process::Process;
use crate::gateway::{Gateway, NODE};
use crate::interface::{Interface, ip};
use crate::rig::{Onset, Rig, Setup, cycles, millis};
use crate::serial_can::Adapter;
use faults::Disturbance;

/// Time in which a drive without frames is torque-free.
const DRIVE_TIMER: std::time::Duration = millis(6);

fn on(node: &'static str) -> Setup {
    Setup { node, ..Setup::default() }
}

#[test]
fn hazard_22_cut_cable_makes_drives_torque_free_in_6_ms() {
    let cable = Interface::cable("vxcan0", "vxcan1");
    let gateway = Gateway::at("vxcan1");
    let mut rig = Rig::engaged("cut", &on("vxcan0"));
    let onset = rig.onset();
    ip("link set vxcan1 down");
    rig.run_for(millis(20));
    rig.is_stopped();
    rig.seen_after(onset, millis(40)).all_are_free_within(DRIVE_TIMER);
    gateway.is_gone();
    drop(cable);
}

#[test]
fn hazard_22_late_frames_of_a_stalled_adapter_do_not_act() {
    let mut adapter = Adapter::plugged("slcan0");
    let mut rig = Rig::engaged("stalled", &on("slcan0"));
    let onset = rig.onset();
    adapter.disturb(Disturbance::AdapterStalled);
    rig.run_for(millis(40));
    adapter.go_on();
    rig.run_for(millis(20));
    rig.is_stopped();
    rig.seen_after(onset, millis(80)).all_are_free_within(DRIVE_TIMER);
}

#[test]
fn hazard_23_bus_off_makes_drives_torque_free_in_6_ms() {
    let mut adapter = Adapter::plugged("slcan0");
    let mut rig = Rig::engaged("bus-off", &on("slcan0"));
    let onset = rig.onset();
    adapter.disturb(Disturbance::BusOff);
    rig.run_for(millis(20));
    rig.is_stopped_by("bus off");
    rig.seen_after(onset, millis(20)).all_are_free_within(DRIVE_TIMER);
}

#[test]
fn hazard_23_error_passive_adapter_stops_all_in_two_cycles() {
    let mut adapter = Adapter::plugged("slcan0");
    let mut rig = Rig::engaged("passive", &on("slcan0"));
    rig.run_for(millis(5));
    adapter.disturb(Disturbance::ErrorWarning);
    rig.run_for(millis(20));
    rig.is("engaged");
    let onset = rig.onset();
    adapter.disturb(Disturbance::ErrorPassive);
    rig.run_for(millis(20));
    rig.is_stopped_by("error passive");
    rig.seen_after(onset, millis(20)).all_are_free_within(cycles(2));
}

/// Sends an error frame to the node's interface, as any program could.
fn error_frame(name: &str, frame: &str) -> (Rig, Onset, Gateway) {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged(name, &Setup::default());
    let onset = rig.onset();
    Process::start("cansend", &[NODE, frame]).wait().succeeds();
    rig.run_for(millis(20));
    (rig, onset, gateway)
}

#[test]
fn hazard_23_error_frame_with_bus_off_ends_all_sending() {
    let (rig, onset, _gateway) = error_frame("error-off", "20000040#0000000000000000");
    rig.is_stopped_by("bus off");
    rig.seen_after(onset, millis(20)).all_are_free_within(DRIVE_TIMER);
}

#[test]
fn hazard_23_passive_error_frame_stops_and_warning_does_not() {
    for frame in ["20000004#0010000000000000", "20000004#0020000000000000"] {
        let (rig, onset, _gateway) = error_frame("error-passive", frame);
        rig.is_stopped_by("error passive");
        rig.seen_after(onset, millis(20)).all_are_free_within(cycles(2));
    }
    let (rig, _, _gateway) = error_frame("error-warning", "20000004#0008000000000000");
    rig.is("engaged");
}

#[test]
fn hazard_24_interface_down_makes_drives_torque_free_in_6_ms() {
    let _interface = Interface::vcan("vcan2");
    let gateway = Gateway::at("vcan2");
    let mut rig = Rig::engaged("down", &on("vcan2"));
    let onset = rig.onset();
    ip("link set vcan2 down");
    rig.run_for(millis(20));
    rig.is_stopped_by("interface down");
    // An interface that is up again needs a reset, which boots.
    ip("link set vcan2 up");
    rig.run_for(millis(20));
    rig.is_stopped_by("interface down");
    rig.seen_after(onset, millis(60)).all_are_free_within(DRIVE_TIMER);
    gateway.is_gone();
}

#[test]
fn hazard_24_reset_checks_an_interface_that_is_up_again() {
    let _adapter = Adapter::plugged("slcan0");
    let mut rig = Rig::engaged("judged", &on("slcan0"));
    let onset = rig.onset();
    ip("link set slcan0 down");
    rig.run_for(millis(20));
    rig.is_stopped_by("interface down");
    ip("link set slcan0 txqueuelen 1000 up");
    rig.run_for(millis(20));
    let refused = rig.ctl("reset");
    let reason = "slcan0: txqueuelen must be at most";
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    assert!(refused.stderr.contains(reason) && refused.stderr.contains("got 1000"), "{refused:?}");
    rig.is("drives-off");
    let note = rig.status()["note"].to_string();
    assert!(note.contains("the last reset failed") && note.contains(reason), "{note}");
    ip("link set slcan0 txqueuelen 16");
    rig.ctl("reset").succeeds();
    rig.run_for(millis(100));
    rig.is("ready");
    rig.seen_after(onset, millis(5)).all_are_free_within(DRIVE_TIMER);
}

#[test]
fn hazard_24_removed_interface_makes_drives_torque_free_in_6_ms() {
    let _interface = Interface::vcan("vcan2");
    let gateway = Gateway::at("vcan2");
    let mut rig = Rig::engaged("taken", &on("vcan2"));
    let onset = rig.onset();
    ip("link del vcan2");
    rig.run_for(millis(20));
    rig.is_stopped_by("interface down");
    rig.seen_after(onset, millis(40)).all_are_free_within(DRIVE_TIMER);
    gateway.is_gone();
}

#[test]
fn hazard_24_unplugged_adapter_makes_drives_torque_free_in_6_ms() {
    let mut adapter = Adapter::plugged("slcan0");
    let mut rig = Rig::engaged("pulled", &on("slcan0"));
    let onset = rig.onset();
    adapter.disturb(Disturbance::AdapterUnplugged);
    rig.run_for(millis(20));
    rig.is_stopped_by("interface down");
    rig.seen_after(onset, millis(40)).all_are_free_within(DRIVE_TIMER);
}
