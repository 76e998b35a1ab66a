//! What a file of measurements came to: what is reported, drawn and written.

use config::torque_data::TorqueData;
use controller::calibration::TorqueCurve;
use controller::fit::Calibrated;
use controller::fit::Sample;

/// A file of measurements and what it came to.
pub(super) struct Session<'a> {
    /// The file's name, without its folder.
    pub(super) file: String,
    pub(super) data: &'a TorqueData,
    pub(super) joints: Vec<Fitted<'a>>,
}

/// What one joint's measurements came to.
pub(super) struct Fitted<'a> {
    /// Its name, the configuration's if there is one.
    pub(super) joint: String,
    pub(super) samples: &'a [Sample],
    /// The curve, or why there is none.
    pub(super) outcome: Result<Accepted, String>,
}

/// A curve that can be used.
pub(super) struct Accepted {
    pub(super) fit: Calibrated,
    /// With as many digits as are written, and proven to rise once more.
    pub(super) curve: TorqueCurve,
    /// How far the samples are from the curve of the configuration, in ‰ RMS.
    pub(super) before: Option<f64>,
    /// The straight line to compare with: what it is, and its slope in ‰ per N·m.
    pub(super) line: (&'static str, f64),
}
