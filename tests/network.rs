//! Five processes: `frhc sim`, `frhc run`, `frhc-link near`, `frhc-link far` and `frhc robot`, with netem as the network between
//! the two ends.
//!
//! Needs vcan0, `tc`, and `frhc-link`; `scripts/test.sh` runs it under `scripts/with_vcan.sh -v`, in virtual time. The bus is the
//! tests' clock: they read candump's lines, and never sleep.
#![allow(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test; figures are to be seen; the wall clock is shared with the recording"
)]

mod common;
#[path = "network/ends.rs"]
mod ends;
#[path = "network/figures.rs"]
mod figures;
#[path = "network/lost.rs"]
mod lost;
#[path = "network/stale.rs"]
mod stale;

use common::documented::{self, Lane};
use common::process::Scratch;

#[test]
fn sh_blocks_of_the_documentation_run_as_written() {
    let scratch = Scratch::new("documented-network");
    let count = documented::run(scratch.path("").as_ref(), |lane| match lane {
        Lane::Network(before) => Some(before),
        Lane::AnyMachine | Lane::Session | Lane::Vcan(_) | Lane::NotRun(_) => None,
    });
    assert_eq!(count, 1);
}
