//! Five processes: `frhc sim`, `frhc run`, `frhc-link near`, `frhc-link far` and `frhc robot`, with netem as the network between
//! the two ends.
//!
//! Needs vcan0, `tc`, and `frhc-link`; `scripts/test.sh` runs it under `scripts/with_vcan.sh -v`, in virtual time. The bus is the
//! tests' clock: they read candump's lines, and never sleep.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test; figures are to be seen"
)]

mod common;
#[path = "network/ends.rs"]
mod ends;
#[path = "network/figures.rs"]
mod figures;
#[path = "network/lost.rs"]
mod lost;
