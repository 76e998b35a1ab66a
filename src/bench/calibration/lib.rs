//! Calibration: torque curves and friction of joints, fitted to measured torques.
//!
//! [`torque_data`] reads the measurements, [`fit`] computes curves and friction.
#![forbid(unsafe_code)]

pub mod fit;
mod least_squares;
pub mod torque_data;
