//! Golden transcripts: the frames of a boot and of a fault reset, in candump's format.
//!
//! `GOLDEN=write cargo test --test memory golden::` rewrites them; check the difference before you commit it.

use crate::common::bench::booted;
use crate::common::golden::compare;
use crate::common::prelude::*;

#[test]
fn boot() {
    let (_, wire) = booted(KRAFT_500HZ, "free");
    compare("boot.log", &wire.transcript(12));
}

#[test]
fn fault_reset() {
    let (mut bench, wire) = booted(KRAFT_500HZ, "free");
    bench.cycle();
    wire.clear();
    bench.world_mut().drive_mut(Joint::of::<3>()).unwrap().fail();
    until(&mut bench, |record| record.mode.is_stopped());
    bench.ask(Request::Reset).unwrap();
    until(&mut bench, |record| record.mode == Mode::Ready);
    compare("fault_reset.log", &wire.transcript(usize::MAX));
}
