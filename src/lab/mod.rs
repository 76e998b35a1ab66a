//! Node and simulation put together: what `demo`, `sim` and the tests stand on.

pub mod attend;
pub mod bench;
pub mod site;
pub mod world;
