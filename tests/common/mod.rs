//! What the integration tests share.
#![allow(dead_code, reason = "each test file is a crate of its own and uses a part of this")]

pub(crate) mod bench;
pub(crate) mod felt;
pub(crate) mod log;
pub(crate) mod oracle;
pub(crate) mod process;
