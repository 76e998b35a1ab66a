//! CANopen (CiA 301) and the drive profile (CiA 402), as pure machines: frames and time in, frames out.

pub mod bits;
pub mod frame;
pub mod object;
pub mod station;
