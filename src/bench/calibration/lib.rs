//! Calibration: measured torques, and the torque curves and friction that are fitted to them.
//!
//! [`torque_data`] reads the measurements, [`fit`] computes.
#![forbid(unsafe_code)]

pub mod fit;
mod least_squares;
pub mod torque_data;
