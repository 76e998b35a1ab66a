//! What the tests of this room and others share.
#![allow(
    clippy::indexing_slicing,
    clippy::missing_panics_doc,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

pub mod plans;
pub mod scripted;
