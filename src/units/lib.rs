//! What every room counts in: time, and the vectors of Cartesian space.
#![forbid(unsafe_code)]

pub mod spatial;
pub mod time;
