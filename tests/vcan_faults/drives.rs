//! Drives that fail and report it: hazards 7 to 9.

use crate::common::prelude::*;
use crate::gateway::{DRIVES, Gateway, NODE};
use crate::rig::{Rig, Setup, cycles, millis};
use crate::script;
use faults::{DeviceFault, Fault, FaultKind, Target};
use sim::scenario::Entry;

/// Emergencies of a drive that is still enabled, so that only the node can take its torque off: over-current, low
/// supply voltage, encoder, manufacturer's own.
const EMERGENCIES: [(Joint, u16, u8, &str); 4] = [
    (ELBOW, 0x2310, 0x03, "joint 3 (elbow): emergency 2310h"),
    (Joint::of::<1>(), 0x3120, 0x05, "joint 1 (azimuth): emergency 3120h"),
    (Joint::of::<6>(), 0x7305, 0x21, "joint 6 (roll): emergency 7305h"),
    (Joint::of::<4>(), 0xFF00, 0x81, "joint 4 (pitch): emergency FF00h"),
];

#[test]
fn hazard_07_any_emergency_stops_all_in_two_cycles() {
    let gateway = Gateway::at(NODE);
    for (joint, code, register, reason) in EMERGENCIES {
        let mut rig = Rig::engaged(&format!("emergency-{code:04X}"), &Setup::default());
        let onset = rig.onset();
        let emergency = FaultKind::Device(DeviceFault::Emergency { code, register });
        rig.inject(&gateway, Target::Joint(joint), emergency);
        rig.run_for(millis(10));
        rig.is_stopped_by(reason);
        let seen = rig.seen_after(onset, millis(20));
        seen.all_are_free_within(cycles(2));
        seen.are_free_together();
    }
}

#[test]
fn hazard_08_failed_drive_stops_the_others_in_two_cycles() {
    let _gateway = Gateway::at(NODE);
    // Well within a press.
    let (start, fault) = (Duration::from_millis(1_050), DeviceFault::DriveFault(0x3210));
    let fault = Fault::new(start, Target::Joint(ELBOW), FaultKind::Device(fault));
    let mut entries = script::rhythm();
    entries.push(Entry::Fault(fault));
    let mut rig = Rig::engaged("fault", &Setup { entries, ..Setup::default() });
    let onset = rig.onset();
    rig.next(0x683);
    rig.run_for(millis(10));
    rig.is_stopped_by("joint 3 (elbow): emergency 3210h");
    let seen = rig.seen_after(onset, millis(20)).from(|entry| entry.id == 0x683);
    seen.are_free_within(cycles(2), |node| node != 3);
}

#[test]
fn hazard_08_disabled_drive_stops_the_others_in_two_cycles() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("left", &Setup::default());
    let onset = rig.onset();
    // "Disable voltage" of another master, which the node does not see.
    Process::start("cansend", &[DRIVES, "303#0000"]).wait().succeeds();
    rig.run_for(millis(10));
    rig.is_stopped_by("joint 3 (elbow): drive left operation enabled");
    let seen = rig.seen_after(onset, millis(20));
    let seen = seen.from(|entry| entry.id == 0x283 && entry.data[0] & 0x6F != 0x27);
    seen.are_free_within(cycles(2), |node| node != 3);
}

#[test]
fn hazard_09_rebooted_drive_switches_all_off_in_two_cycles() {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("reboot", &Setup::default());
    let onset = rig.onset();
    rig.inject(&gateway, Target::Joint(ELBOW), FaultKind::Device(DeviceFault::Reboot));
    rig.run_for(millis(10));
    rig.is_stopped_by("joint 3 (elbow): rebooted");
    let seen = rig.seen_after(onset, millis(20));
    let seen = seen.from(|entry| entry.id == 0x703 && entry.data == [0]);
    seen.all_are_free_within(cycles(2));
    seen.all_are_switched_off();
}
