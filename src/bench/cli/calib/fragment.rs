//! `torque_curves.toml`: the keys of every joint that a calibration replaces, with their origin.

use crate::calib::report;
use crate::calib::session::{CurveResult, Evidence, Session};
use controller::calibration::{InvalidTorqueCurve, TorqueCurve};
use telemetry::digits::significant;
use units::wording::counted;

/// Significant digits of a coefficient; the rounding error is a thousandth of a step of the drive.
const DIGITS: usize = 7;
/// Resolution of the end of a range: steps per N·m.
const ENDS: f64 = 1e4;

/// Returns the curve rounded to the digits that are written, its range rounded down.
///
/// # Errors
/// Returns an error if the rounded curve is not monotone.
pub(super) fn written(curve: &TorqueCurve) -> Result<TorqueCurve, InvalidTorqueCurve> {
    let coefficients = curve.coefficients().map(|c| significant(c, DIGITS));
    TorqueCurve::new(coefficients, (curve.max_torque() * ENDS).floor() / ENDS)
}

/// Returns the content of the file.
pub(super) fn text(session: &Session<'_>) -> String {
    let mut lines = vec![
        format!(
            "# Torque curves by frhc {} calib fit, from {}.",
            env!("CARGO_PKG_VERSION"),
            session.file
        ),
        "# For the [[joint]] of the same name: frhc config merge MY.toml FILE puts the keys in."
            .to_owned(),
    ];
    if !session.data.provenance.is_empty() {
        lines.push("#\n# Origin of the measurements:".to_owned());
    }
    lines.extend(session.data.provenance.iter().map(|comment| format!("#   {comment}")));
    lines.extend(session.joints.iter().map(|fitted| joint(session, fitted)));
    lines.join("\n") + "\n"
}

fn joint(session: &Session<'_>, fitted: &CurveResult<'_>) -> String {
    let CurveResult { joint, measured, reasons, .. } = fitted;
    let Some(Evidence { fit, curve, .. }) = fitted.accepted() else {
        let reasons = reasons.iter().map(|reason| format!("\n# {joint}: rejected: {reason}"));
        return reasons.collect();
    };
    let origin = report::origin(session, measured);
    let unit = report::unit(session.data.is_force);
    let residuals = fit.both.residuals;
    let friction = fit.friction;
    let [c1, c3, c5] = curve.coefficients();
    let end = if session.data.is_force { "max_force_n" } else { "max_torque_nm" };
    let lines = [
        "\n[[joint]]".to_owned(),
        format!("name = {}", toml_string(joint)),
        format!("# {origin}"),
        format!(
            "# residual {:.2} ‰ RMS, {:.2} ‰ at most; leave-one-out {:.2} ‰ RMS",
            residuals.rms, residuals.largest, residuals.left_out_rms
        ),
        format!(
            "# friction {:.4} {unit}, hysteresis {:.4} {unit}; {} left out",
            friction.torque,
            friction.hysteresis(),
            counted(fit.outliers.len(), "reading")
        ),
        format!("{end} = {:?}", curve.max_torque()),
        format!(
            "torque_curve = [{c1:?}, {c3:?}, {c5:?}]    # slope at least {} ‰/{unit}",
            significant(curve.least_slope().0, 4)
        ),
    ];
    lines.join("\n")
}

/// Formats a one-line string as TOML.
pub(super) fn toml_string(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\t', "\\t"))
}
