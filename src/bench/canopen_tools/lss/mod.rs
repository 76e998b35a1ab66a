//! LSS master (CiA 305): pure machines that configure devices by one job after another.

pub mod fastscan;
pub mod identify;
pub mod job;
pub mod master;
