//! The faults of docs/safety.md on SocketCAN, between real processes, in virtual time.
//!
//! ```text
//!  frhc run ── vcan0 ──── cangw: one rule for each frame and direction ──── vcan1 ── frhc sim
//!                │                                                            │
//!               tc: delays, a full queue                                   candump: what the drives see
//!
//!  frhc run ── vxcan0 ═ vxcan1 ── cangw ── vcan1            a bus that can be cut
//!  frhc run ── slcan0 ═ pty ═ the adapter ── vcan1          an adapter that stalls, reports errors, is unplugged
//! ```
//!
//! A test injects one fault at a random phase of the cycle, lets the bus run on, and reads from the drives' side when
//! each drive was torque-free. Every test has its own node and its own drives.
//! Needs vcan0 and vcan1, made with `echo=1`; `scripts/test.sh` runs it under `scripts/with_vcan.sh -v`.
#![allow(
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]
#![allow(
    clippy::disallowed_methods,
    reason = "in virtual time a sleep ends when it should: it is how a phase of the cycle is chosen"
)]

#[path = "../common/mod.rs"]
mod common;

mod adapter;
mod boot;
mod console;
mod drives;
mod frames;
mod gateway;
mod host;
mod hostile;
mod inject;
mod interface;
mod killed;
mod operator;
mod queue;
mod reaction;
mod rig;
mod script;
mod serial_can;
mod shaper;
mod signals;
mod torque;
