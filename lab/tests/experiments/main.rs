//! The experiments, and what is felt in them: on the in-memory bus, and as a user runs them.
#![allow(
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test; figures are to be seen"
)]

mod common;

mod commands;
mod compensated_push;
mod dual_peg;
mod fidelity;
mod figures;
mod peg;
mod refused;
mod terminal;
