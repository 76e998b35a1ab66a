//! Calibration: measured torques, and the torque curves and friction that are fitted to them.
//!
//! [`torque_data`] reads the measurements, [`fit`] computes, [`torque_plot`] shows both.
#![forbid(unsafe_code)]

mod chart;
pub mod fit;
mod least_squares;
pub mod torque_data;
pub mod torque_plot;
