//! Report of `frhc calib fit` on every joint, as text and JSON.

use std::fmt::Write;

use crate::cli::calib::session::{Accepted, Fitted, Session};
use controller::fit::{Calibrated, Polynomial, Residuals, Sample};
use telemetry::digits::significant;

/// Returns the unit of the measurements.
pub(super) const fn unit(session: &Session<'_>) -> &'static str {
    if session.data.is_force { "N" } else { "N·m" }
}

/// Returns file, number and dates of a joint's samples in one line.
pub(super) fn origin(session: &Session<'_>, samples: &[Sample]) -> String {
    let mut origin = format!("{}: {} samples", session.file, samples.len());
    if let Some(first) = session.data.dates.first() {
        origin.push_str(&format!(", {first}"));
    }
    if let Some(last) = session.data.dates.get(1..).and_then(<[String]>::last) {
        origin.push_str(&format!(" to {last}"));
    }
    origin
}

/// Returns a table for every joint.
pub(super) fn text(session: &Session<'_>) -> String {
    let joints = session.joints.iter().map(|Fitted { joint, samples, outcome }| {
        let origin = origin(session, samples);
        match outcome {
            Ok(accepted) => format!("{joint}: {origin}\n{}", table(accepted, unit(session))),
            Err(reason) => format!("{joint}: {origin}\n  rejected: {reason}"),
        }
    });
    joints.collect::<Vec<_>>().join("\n\n")
}

fn table(Accepted { fit, curve, before, .. }: &Accepted, unit: &str) -> String {
    let mut table = format!(
        "  {:18}{:>12}{:>12}{:>12}{:>9}{:>11}{:>11}\n",
        "c in ‰ of rated", "c1", "c3", "c5", "RMS ‰", "largest ‰", "LOO ‰"
    );
    let odd = [("both directions", &fit.both), ("driven up", &fit.up), ("driven down", &fit.down)];
    for (name, polynomial) in odd {
        table.push_str(&row(name, polynomial));
    }
    table.push_str(&row("straight line", &fit.line));
    let (slope, at) = curve.least_slope();
    let hysteresis = fit.hysteresis;
    let turned = if fit.is_reversed { "against" } else { "with" };
    let mut lines = vec![
        format!("range        ±{} {unit}; targets saturate at its ends", curve.max_torque()),
        format!("monotone     yes, slope at least {slope:.2} ‰/{unit}, at {at:.3} {unit}"),
        format!(
            "hysteresis   {:.4} {unit} wide on average, {:.4} {unit} at most; {:.1} ‰ and {:.1} ‰",
            hysteresis.mean_torque,
            hysteresis.largest_torque,
            hysteresis.mean_per_mille,
            hysteresis.largest_per_mille
        ),
        format!("motor        turns {turned} the joint"),
    ];
    lines.extend(before.map(|rms| format!("configured   residual of its curve {rms:.2} ‰ RMS")));
    for line in lines {
        write!(table, "\n  {line}").ok(); // writing to a String cannot fail
    }
    table
}

/// Formats a polynomial's coefficients and residuals.
fn row<const P: usize>(name: &str, polynomial: &Polynomial<P>) -> String {
    let Residuals { rms, largest, left_out_rms } = polynomial.residuals;
    let mut row = format!("  {name:18}");
    let coefficients = polynomial.coefficients.iter().map(|c| significant(*c, 6).to_string());
    for coefficient in coefficients.chain(std::iter::repeat(String::new())).take(3) {
        row.push_str(&format!("{coefficient:>12}"));
    }
    row + &format!("{rms:>9.2}{largest:>11.2}{left_out_rms:>11.2}\n")
}

/// Returns the report as one JSON object.
pub(super) fn json(session: &Session<'_>) -> serde_json::Value {
    let joints = session.joints.iter().map(|Fitted { joint, samples, outcome }| match outcome {
        Ok(accepted) => accepted_json(joint, samples.len(), accepted),
        Err(reason) => serde_json::json!({
            "joint": joint, "samples": samples.len(), "accepted": false, "reason": reason,
        }),
    });
    serde_json::json!({
        "ok": session.joints.iter().all(|fitted| fitted.outcome.is_ok()),
        "data": session.file,
        "provenance": session.data.provenance,
        "dates": session.data.dates,
        "unit": unit(session),
        "joints": joints.collect::<Vec<_>>(),
    })
}

fn accepted_json(joint: &str, samples: usize, accepted: &Accepted) -> serde_json::Value {
    let Accepted { fit, curve, before, .. } = accepted;
    let Calibrated { both, up, down, line, hysteresis, is_reversed, .. } = fit;
    let (least_slope, at) = curve.least_slope();
    serde_json::json!({
        "joint": joint,
        "samples": samples,
        "accepted": true,
        "torque_curve": curve.coefficients(),
        "max_torque": curve.max_torque(),
        "motor_turns_against_joint": is_reversed,
        "monotone": { "least_slope_per_mille": least_slope, "at": at },
        "configured_off_rms_per_mille": before,
        "both": polynomial_json(both),
        "up": polynomial_json(up),
        "down": polynomial_json(down),
        "straight_line": polynomial_json(line),
        "hysteresis": {
            "mean": hysteresis.mean_torque,
            "largest": hysteresis.largest_torque,
            "mean_per_mille": hysteresis.mean_per_mille,
            "largest_per_mille": hysteresis.largest_per_mille,
        },
    })
}

fn polynomial_json<const P: usize>(polynomial: &Polynomial<P>) -> serde_json::Value {
    let Residuals { rms, largest, left_out_rms } = polynomial.residuals;
    serde_json::json!({
        "coefficients": polynomial.coefficients.to_vec(),
        "residual_rms_per_mille": rms,
        "residual_largest_per_mille": largest,
        "left_out_rms_per_mille": left_out_rms,
    })
}
