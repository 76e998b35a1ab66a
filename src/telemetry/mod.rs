//! Records and changes, out of the loop: what the cycle leaves behind for people and files.

pub mod candump;
pub mod record;
pub mod session;
pub mod status;
pub mod summary;
