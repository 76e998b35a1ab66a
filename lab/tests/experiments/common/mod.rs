//! Parts of the tests of the first workspace that these use, too.
#![allow(dead_code, reason = "these tests use a part of this")]

#[path = "../../../../tests/common/bench.rs"]
pub(crate) mod bench;
#[path = "../../../../tests/common/cli.rs"]
pub(crate) mod cli;
#[path = "../../../../tests/common/on_terminal.rs"]
pub(crate) mod on_terminal;
pub(crate) mod prelude;
#[path = "../../../../tests/common/shipped.rs"]
pub(crate) mod shipped;

/// Root of the repository.
pub(crate) const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Returns the program under test.
pub(crate) const fn program() -> &'static str {
    env!("CARGO_BIN_EXE_frhc-lab")
}
