//! Node and simulation put together: what `demo`, `sim` and the tests stand on.

pub mod attend;
pub mod bench;
pub mod campaign;
pub mod comparison;
pub mod explanation;
pub mod outbox;
pub mod question;
pub mod site;
pub mod world;
