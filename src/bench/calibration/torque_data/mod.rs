//! Measured joint torques as text files, one reading per line: input of the fits of torque curves and friction.

mod curve;
mod readings;
mod sweep;

pub use crate::torque_data::curve::{JointReadings, TorqueData};
pub use crate::torque_data::sweep::{JointSweep, SweepData, SweepReading};
