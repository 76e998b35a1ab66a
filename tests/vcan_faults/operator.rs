//! The deadman: row 38.

use std::time::Duration;

use crate::gateway::Gateway;
use crate::gateway::NODE;
use crate::gateway::Way;
use crate::rig::Onset;
use crate::rig::Rig;
use crate::rig::Setup;
use crate::rig::cycles;
use crate::rig::millis;
use crate::seen::Seen;

/// The azimuth carries no weight: what it is told is all of it felt.
const AZIMUTH: u16 = 1;

/// The switch box tells its inputs as often as this.
const TELLS_EVERY: Duration = millis(5);

fn is_felt_no_more(seen: &Seen, Onset(onset): Onset, most: Duration) {
    let torque = seen.torque(AZIMUTH);
    assert_ne!(torque.at(onset), 0, "something is felt");
    let ends = torque.ends_after(onset);
    assert!(ends.is_some_and(|ends| ends <= most), "{ends:?}");
}

#[test]
fn hazard_38_a_deadman_that_is_released_ends_what_is_felt_within_20_ms() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("released", &Setup::default());
    let onset = rig.released();
    rig.run_for(millis(30));
    rig.is("armed");
    is_felt_no_more(&rig.seen_after(onset, millis(40)), onset, millis(20) + cycles(1));
}

#[test]
fn hazard_38_a_switch_box_that_falls_silent_is_a_deadman_that_is_released() {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("silent", &Setup::default());
    let onset = rig.onset();
    gateway.lose(Way::ToNode, 0x190);
    rig.run_for(millis(60));
    let most = TELLS_EVERY * 3 + millis(20);
    is_felt_no_more(&rig.seen_after(onset, millis(60)), onset, most);
}
