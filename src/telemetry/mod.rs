//! Records and changes, out of the loop: what the cycle leaves behind for people and files.

pub mod candump;
pub mod cause;
mod chart;
pub mod contact;
pub mod digits;
pub mod fault_record;
pub mod losses;
pub mod origin;
pub mod record;
pub mod screen;
pub mod session;
pub mod status;
pub mod summary;
pub mod token_bucket;
pub mod torque_plot;
