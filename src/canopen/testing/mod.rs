//! Test fixtures of this crate, shared with others.
#![allow(
    clippy::indexing_slicing,
    clippy::missing_panics_doc,
    clippy::unwrap_used,
    reason = "a missing fixture fails the test"
)]

pub mod networks;
pub mod plans;
pub mod scripted;
