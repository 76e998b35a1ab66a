//! Node and simulation put together: what `demo`, `sim` and the tests stand on.
#![forbid(unsafe_code)]

pub mod attend;
pub mod bench;
pub mod campaign;
pub mod comparison;
pub mod explanation;
pub mod outbox;
pub mod question;
pub mod world;
