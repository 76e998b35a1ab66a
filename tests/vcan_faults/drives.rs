//! Drives that fail, and say so: rows 7 to 9.

use crate::common::process::Process;
use crate::gateway::DRIVES;
use crate::gateway::Gateway;
use crate::gateway::NODE;
use crate::gateway::Way;
use crate::rig::Rig;
use crate::rig::Setup;
use crate::rig::cycles;
use crate::rig::millis;
use crate::script;

/// Says a frame on the drives' side.
fn say(frame: &str) {
    Process::of("cansend", &[DRIVES, frame]).wait().succeeds();
}

/// Frames of a drive that is still enabled, so that only the node can take its torque off: over-current,
/// supply too low, encoder, and one that is nobody's.
const EMERGENCIES: [(&str, &str); 4] = [
    ("683#1023030000270600", "joint 3: emergency 2310h"),
    ("681#2031050000270600", "joint 1: emergency 3120h"),
    ("686#0573210000270600", "joint 6: emergency 7305h"),
    ("684#00FF810000270600", "joint 4: emergency FF00h"),
];

#[test]
fn hazard_07_whatever_emergency_a_drive_tells_all_torque_is_off_two_cycles_later() {
    let _gateway = Gateway::at(NODE);
    for (place, (frame, reason)) in EMERGENCIES.into_iter().enumerate() {
        let mut rig = Rig::engaged(&format!("emergency-{place}"), &Setup::default());
        let onset = rig.onset();
        say(frame);
        rig.run_for(millis(10));
        rig.is_stopped_by(reason);
        let seen = rig.seen_after(onset, millis(20));
        seen.all_are_free_within(cycles(2));
        seen.are_free_together();
    }
}

#[test]
fn hazard_08_when_a_drive_fails_the_five_others_are_free_two_cycles_later() {
    let _gateway = Gateway::at(NODE);
    // Well within a press.
    let fault = "[[fault]]\nat_s = 1.05\nkind = \"fault\"\njoint = 3\ncode = 0x3210\n";
    let setup = Setup { script: script::rhythm() + fault, ..Setup::default() };
    let mut rig = Rig::engaged("fault", &setup);
    let onset = rig.onset();
    rig.next(0x683);
    rig.run_for(millis(10));
    rig.is_stopped_by("joint 3: emergency 3210h");
    let seen = rig.seen_after(onset, millis(20)).from(|entry| entry.id == 0x683);
    seen.are_free_within(cycles(2), |node| node != 3);
}

#[test]
fn hazard_08_when_a_drive_leaves_operation_enabled_the_five_others_are_free_two_cycles_later() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("left", &Setup::default());
    let onset = rig.onset();
    // Another's "disable voltage".
    say("303#0000");
    rig.run_for(millis(10));
    rig.is_stopped_by("joint 3: drive left operation enabled");
    let seen = rig.seen_after(onset, millis(20));
    let seen = seen.from(|entry| entry.id == 0x283 && entry.data[0] & 0x6F != 0x27);
    seen.are_free_within(cycles(2), |node| node != 3);
}

#[test]
fn hazard_09_a_drive_that_boots_up_by_itself_switches_all_off_within_two_cycles() {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("reboot", &Setup::default());
    // The node sees a drive that boots, not who told it to.
    gateway.lose(Way::ToNode, 0x000);
    let onset = rig.onset();
    say("000#8103");
    rig.run_for(millis(10));
    rig.is_stopped_by("joint 3: rebooted");
    let seen = rig.seen_after(onset, millis(20));
    let seen = seen.from(|entry| entry.id == 0x703 && entry.data == [0]);
    seen.all_are_free_within(cycles(2));
    seen.all_are_switched_off();
}
