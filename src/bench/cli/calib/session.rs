//! Results of fitting a file of measurements.

use calibration::fit::CurveFit;
use calibration::torque_data::{JointReadings, TorqueData};
use controller::calibration::TorqueCurve;

/// File of measurements with the results of its joints.
pub(super) struct Session<'a> {
    /// File name without its folder.
    pub(super) file: String,
    pub(super) data: &'a TorqueData,
    pub(super) joints: Vec<CurveResult<'a>>,
}

/// Fitted curve of one joint, with the verdict on it.
pub(super) struct CurveResult<'a> {
    /// Name of the joint: that of the configuration, if given.
    pub(super) joint: String,
    pub(super) measured: &'a JointReadings,
    /// Fitted curve; `None` if the measurements do not determine one.
    pub(super) evidence: Option<Evidence>,
    /// Reasons to reject the curve; empty if accepted.
    pub(super) reasons: Vec<String>,
    /// Remarks that do not affect acceptance.
    pub(super) warnings: Vec<String>,
}

/// Fitted curve with figures for comparison.
pub(super) struct Evidence {
    pub(super) fit: CurveFit,
    /// Curve rounded to the written digits; monotone.
    pub(super) curve: TorqueCurve,
    /// Residual of the samples against the configured curve, in ‰ RMS.
    pub(super) before: Option<f64>,
    /// Straight line for comparison: its name, and its slope in ‰ per N·m.
    pub(super) line: (&'static str, f64),
}

impl CurveResult<'_> {
    /// Returns the curve; `None` if rejected.
    pub(super) fn accepted(&self) -> Option<&Evidence> {
        self.evidence.as_ref().filter(|_| self.reasons.is_empty())
    }

    /// Returns line and distance of each outlier, in the order of the lines.
    pub(super) fn outliers(&self) -> Vec<(usize, f64)> {
        let outliers = self.evidence.iter().flat_map(|evidence| &evidence.fit.outliers);
        let line = |place: usize| self.measured.lines.get(place).copied();
        outliers.filter_map(|outlier| Some((line(outlier.place)?, outlier.distance))).collect()
    }
}
