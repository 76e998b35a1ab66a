//! The deadman: hazard 38.

use std::time::Duration;

use crate::gateway::{Gateway, NODE};
use crate::inject::{POSITION, every};
use crate::reaction::Reaction;
use crate::rig::{Onset, Rig, Setup, cycles, millis};
use faults::{Effect, Target};

/// The azimuth has no gravity torque: its targets contain only reflection.
const AZIMUTH: u16 = 1;

/// Period of the switch box's TPDO.
const INPUT_PERIOD: Duration = millis(5);

fn reflection_has_ended(seen: &Reaction, Onset(onset): Onset, most: Duration) {
    let torque = seen.torque(AZIMUTH);
    assert_ne!(torque.at(onset), 0, "there was reflection");
    let ends = torque.ends_after(onset);
    assert!(ends.is_some_and(|ends| ends <= most), "{ends:?}");
}

#[test]
fn hazard_38_released_deadman_ends_reflection_in_20_ms() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("released", &Setup::default());
    let onset = rig.released();
    rig.run_for(millis(30));
    rig.is("armed");
    reflection_has_ended(&rig.seen_after(onset, millis(40)), onset, millis(20) + cycles(1));
}

#[test]
fn hazard_38_silent_switch_box_counts_as_a_released_deadman() {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("silent", &Setup::default());
    let onset = rig.onset();
    rig.inject(&gateway, Target::SwitchBox, every(POSITION, Effect::Drop));
    rig.run_for(millis(60));
    let most = INPUT_PERIOD * 3 + millis(20);
    reflection_has_ended(&rig.seen_after(onset, millis(60)), onset, most);
}
