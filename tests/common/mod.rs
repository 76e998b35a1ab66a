//! Shared parts of the integration tests.
#![allow(dead_code, reason = "each test file is a crate of its own and uses a part of this")]

use std::env;
use std::sync::LazyLock;

pub(crate) mod bench;
pub(crate) mod cli;
pub(crate) mod devices;
pub(crate) mod documented;
pub(crate) mod drive;
pub(crate) mod examples;
pub(crate) mod felt;
pub(crate) mod golden;
pub(crate) mod linked;
pub(crate) mod log;
pub(crate) mod on_terminal;
pub(crate) mod oracle;
pub(crate) mod prelude;
pub(crate) mod process;
pub(crate) mod refusals;
pub(crate) mod rest;
pub(crate) mod rig;
pub(crate) mod sessions;
pub(crate) mod sh_blocks;
pub(crate) mod shipped;
pub(crate) mod zero;

/// Returns the program under test: `$FRHC_PROGRAM` if it is set, else that of this build.
pub(crate) fn program() -> &'static str {
    static PROGRAM: LazyLock<String> = LazyLock::new(|| {
        env::var("FRHC_PROGRAM").unwrap_or_else(|_| env!("CARGO_BIN_EXE_frhc").to_owned())
    });
    &PROGRAM
}

/// Returns `frhc-link`: `$FRHC_LINK_PROGRAM` if it is set, else that of the last build of its workspace.
pub(crate) fn link_program() -> &'static str {
    static PROGRAM: LazyLock<String> = LazyLock::new(|| {
        let built = concat!(env!("CARGO_MANIFEST_DIR"), "/link/target/debug/frhc-link");
        env::var("FRHC_LINK_PROGRAM").unwrap_or_else(|_| built.to_owned())
    });
    &PROGRAM
}
