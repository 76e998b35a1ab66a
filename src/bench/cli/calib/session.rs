//! Results of fitting a file of measurements.

use calibration::fit::Calibrated;
use calibration::torque_data::{Measured, TorqueData};
use controller::calibration::TorqueCurve;

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
    pub(super) measured: &'a Measured,
    /// The curve, if the measurements determine one.
    pub(super) evidence: Option<Evidence>,
    /// Reasons of its rejection; without one it is accepted.
    pub(super) reasons: Vec<String>,
    /// Remarks that do not reject it.
    pub(super) warnings: Vec<String>,
}

/// A fitted curve.
pub(super) struct Evidence {
    pub(super) fit: Calibrated,
    /// Curve rounded to the digits that are written; proven monotone.
    pub(super) curve: TorqueCurve,
    /// Residual of the samples against the configured curve, in ‰ RMS.
    pub(super) before: Option<f64>,
    /// Straight line to compare with: its name, and its slope in ‰ per N·m.
    pub(super) line: (&'static str, f64),
}

impl Fitted<'_> {
    /// Returns the curve, if it is accepted.
    pub(super) fn accepted(&self) -> Option<&Evidence> {
        self.evidence.as_ref().filter(|_| self.reasons.is_empty())
    }

    /// Returns line and distance of each reading that was left out, in the order of the lines.
    pub(super) fn outliers(&self) -> Vec<(usize, f64)> {
        let outliers = self.evidence.iter().flat_map(|evidence| &evidence.fit.outliers);
        let line = |place: usize| self.measured.lines.get(place).copied();
        outliers.filter_map(|outlier| Some((line(outlier.place)?, outlier.distance))).collect()
    }
}
