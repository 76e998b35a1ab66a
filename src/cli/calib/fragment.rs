//! `torque_curves.toml`: the keys of every joint that a calibration replaces, and where they come from.

use crate::cli::calib::report;
use crate::cli::calib::session::Accepted;
use crate::cli::calib::session::Fitted;
use crate::cli::calib::session::Session;
use controller::calibration::InvalidTorqueCurve;
use controller::calibration::TorqueCurve;
use telemetry::digits::significant;

/// Digits of a coefficient: what they leave out is a thousandth of a step of the drive.
const DIGITS: usize = 7;
/// Steps of a range's end per N·m.
const ENDS: f64 = 1e4;

/// The curve with as many digits as are written, its range not a digit longer.
///
/// # Errors
/// Unless it rises as written.
pub(super) fn written(curve: &TorqueCurve) -> Result<TorqueCurve, InvalidTorqueCurve> {
    let coefficients = curve.coefficients().map(|c| significant(c, DIGITS));
    TorqueCurve::new(coefficients, (curve.max_torque() * ENDS).floor() / ENDS)
}

/// The file.
pub(super) fn text(session: &Session<'_>) -> String {
    let mut lines = vec![
        format!(
            "# Torque curves by frhc {} calib fit, from {}.",
            env!("CARGO_PKG_VERSION"),
            session.file
        ),
        "# They replace the keys of the same names in the [[joint]] of that name.".to_owned(),
    ];
    if !session.data.provenance.is_empty() {
        lines.push("#\n# Of the measurements:".to_owned());
    }
    lines.extend(session.data.provenance.iter().map(|comment| format!("#   {comment}")));
    lines.extend(session.joints.iter().map(|fitted| joint(session, fitted)));
    lines.join("\n") + "\n"
}

fn joint(session: &Session<'_>, Fitted { joint, samples, outcome }: &Fitted<'_>) -> String {
    let Accepted { fit, curve, .. } = match outcome {
        Ok(accepted) => accepted,
        Err(reason) => return format!("\n# {joint}: rejected: {reason}"),
    };
    let (origin, unit) = (report::origin(session, samples), report::unit(session));
    let residuals = fit.both.residuals;
    let hysteresis = fit.hysteresis;
    let [c1, c3, c5] = curve.coefficients();
    let end = if session.data.is_force { "max_force_n" } else { "max_torque_nm" };
    let lines = [
        "\n[[joint]]".to_owned(),
        format!("name = {}", toml_string(joint)),
        format!("# {origin}"),
        format!(
            "# residual {:.2} ‰ RMS, {:.2} ‰ at most; each sample left out {:.2} ‰ RMS",
            residuals.rms, residuals.largest, residuals.left_out_rms
        ),
        format!(
            "# hysteresis {:.4} {unit} on average, {:.4} {unit} at most",
            hysteresis.mean_torque, hysteresis.largest_torque
        ),
        format!("{end} = {:?}", curve.max_torque()),
        format!(
            "torque_curve = [{c1:?}, {c3:?}, {c5:?}]    # rises by {} ‰/{unit} at least",
            significant(curve.least_slope().0, 4)
        ),
    ];
    lines.join("\n")
}

/// A string of one line, as TOML writes it.
fn toml_string(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\t', "\\t"))
}
