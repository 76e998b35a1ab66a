//! Golden transcripts: the frames of a boot and of a fault reset, in candump's format.
//!
//! `GOLDEN=write cargo test --test memory golden::` rewrites them; check the difference before you commit it.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use crate::common::bench::{booted, until};
use crate::common::golden::compare;
use node::Request;
use node::record::Mode;
use units::numbering::Joint;

#[test]
fn boot() {
    let (_, wire) = booted("config/kraft_like_500hz.toml", "free");
    compare("boot.log", &wire.transcript(12));
}

#[test]
fn fault_reset() {
    let (mut bench, wire) = booted("config/kraft_like_500hz.toml", "free");
    bench.cycle();
    wire.clear();
    bench.world_mut().drive_mut(Joint::of::<3>()).unwrap().fail();
    until(&mut bench, |record| record.mode.is_stopped());
    bench.ask(Request::Reset).unwrap();
    until(&mut bench, |record| record.mode == Mode::Ready);
    compare("fault_reset.log", &wire.transcript(usize::MAX));
}
