//! Two processes on vcan, `frhc run` and `frhc sim`, and can-utils' candump.
//!
//! Needs vcan0; `scripts/test.sh` runs it under `scripts/with_vcan.sh -v`, in virtual time. The bus is the tests' clock:
//! they read candump's lines, and never sleep.
#![allow(
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;
#[path = "vcan/ends.rs"]
mod ends;
#[path = "vcan/far_side.rs"]
mod far_side;
#[path = "vcan/first_torque.rs"]
mod first_torque;
#[path = "vcan/link_peer.rs"]
mod link_peer;
#[path = "vcan/park.rs"]
mod park;
#[path = "vcan/proof.rs"]
mod proof;
#[path = "vcan/realtime.rs"]
mod realtime;
#[path = "vcan/recordings.rs"]
mod recordings;
#[path = "vcan/sessions.rs"]
mod sessions;
#[path = "vcan/sign.rs"]
mod sign;
#[path = "vcan/socket.rs"]
mod socket;
#[path = "vcan/telemetry.rs"]
mod telemetry;
#[path = "vcan/teleoperation.rs"]
mod teleoperation;
#[path = "vcan/tools.rs"]
mod tools;
#[path = "vcan/zero.rs"]
mod zero;

use common::documented::{self, Lane};
use common::prelude::*;

/// The other `sh` blocks: see `tests/program/documented.rs`.
#[test]
fn sh_blocks_of_the_documentation_run_as_written() {
    let scratch = Scratch::new("documented");
    let count = documented::run(scratch.path("").as_ref(), |lane| match lane {
        Lane::Vcan(before) => Some(before),
        Lane::AnyMachine | Lane::Session | Lane::Network(_) | Lane::NotRun(_) => None,
    });
    assert!(count > 10, "{count}");
}
