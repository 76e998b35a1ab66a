//! Measured joint torques as text files, one reading per line: input of the fit of torque curves.

mod curve;
mod readings;

pub use crate::torque_data::curve::{Measured, TorqueData};
