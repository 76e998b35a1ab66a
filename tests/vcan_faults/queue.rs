//! A bus slower than its node: hazard 21.

use crate::gateway::{Gateway, NODE};
use crate::rig::{Rig, Setup, cycles, millis};
use crate::shaper::Shaper;

#[test]
fn hazard_21_full_transmit_queue_stops_all_in_five_cycles() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("full", &Setup::default());
    let onset = rig.onset();
    let shaper = Shaper::of_a_slow_bus(NODE);
    rig.run_for(millis(20));
    rig.is_stopped_by("transmit queue full");
    rig.run_for(millis(20));
    drop(shaper);
    // Queued targets must not act when the queue drains.
    let seen = rig.seen_after(onset, millis(80));
    seen.all_are_free_within(cycles(5));
}
