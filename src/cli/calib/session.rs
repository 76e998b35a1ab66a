//! Results of fitting a file of measurements.

use config::torque_data::TorqueData;
use controller::calibration::TorqueCurve;
use controller::fit::{Calibrated, Sample};

/// A file of measurements and the results of its joints.
pub(super) struct Session<'a> {
    /// File name without its folder.
    pub(super) file: String,
    pub(super) data: &'a TorqueData,
    pub(super) joints: Vec<Fitted<'a>>,
}

/// Result of one joint.
pub(super) struct Fitted<'a> {
    /// Name of the joint: that of the configuration, if given.
    pub(super) joint: String,
    pub(super) samples: &'a [Sample],
    /// The curve, or the reason of its rejection.
    pub(super) outcome: Result<Accepted, String>,
}

/// A valid curve.
pub(super) struct Accepted {
    pub(super) fit: Calibrated,
    /// Curve rounded to the digits that are written; proven monotone.
    pub(super) curve: TorqueCurve,
    /// Residual of the samples against the configured curve, in ‰ RMS.
    pub(super) before: Option<f64>,
    /// Straight line to compare with: its name, and its slope in ‰ per N·m.
    pub(super) line: (&'static str, f64),
}
