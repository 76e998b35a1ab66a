//! Report of `frhc calib fit` on every joint, as text and JSON.

use std::fmt::Write;

use crate::calib::session::{CurveResult, Evidence, Session};
use calibration::fit::{CurveFit, Polynomial, Residuals};
use calibration::torque_data::JointReadings;
use telemetry::digits::significant;
use units::wording::counted;

/// Returns the unit of the measurements.
pub(super) const fn unit(is_force: bool) -> &'static str {
    if is_force { "N" } else { "N·m" }
}

/// Returns file, number and dates of a joint's samples in one line.
pub(super) fn origin(session: &Session<'_>, measured: &JointReadings) -> String {
    let mut origin = format!("{}: {}", session.file, counted(measured.samples.len(), "sample"));
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
    let unit = unit(session.data.is_force);
    let joints = session.joints.iter().map(|fitted| {
        let origin = origin(session, fitted.measured);
        let table = fitted.evidence.iter().map(|evidence| table(fitted, evidence, unit));
        let notes = [("warning", &fitted.warnings), ("rejected", &fitted.reasons)];
        let notes = notes.into_iter().flat_map(|(kind, notes)| {
            notes.iter().map(move |note| format!("  {:12} {note}", format!("{kind}:")))
        });
        let lines =
            std::iter::once(format!("{}: {origin}", fitted.joint)).chain(table).chain(notes);
        lines.collect::<Vec<_>>().join("\n")
    });
    joints.collect::<Vec<_>>().join("\n\n")
}

fn table(
    fitted: &CurveResult<'_>,
    Evidence { fit, curve, before, .. }: &Evidence,
    unit: &str,
) -> String {
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
    let friction = fit.friction;
    let turned = if fit.is_reversed { "against" } else { "with" };
    let mut lines = vec![
        format!("range        ±{} {unit}; targets saturate at its ends", curve.max_torque()),
        format!("monotone     yes, slope at least {slope:.2} ‰/{unit}, at {at:.3} {unit}"),
        format!(
            "friction     {:.4} ± {:.4} {unit}, {:.1} ‰ at zero torque",
            friction.torque, friction.deviation, friction.per_mille
        ),
        format!(
            "hysteresis   {:.4} {unit}, twice the friction; the directions are {:.4} {unit} apart at most",
            friction.hysteresis(),
            friction.widest
        ),
        format!("even part    {:.2} % of the end, at most 2 %", 100.0 * fit.unevenness.share),
        format!("left out     {}", left_out(fitted, unit)),
        format!("motor        turns {turned} the joint"),
    ];
    lines.extend(before.map(|rms| format!("configured   residual of its curve {rms:.2} ‰ RMS")));
    for line in lines {
        write!(table, "\n  {line}").ok(); // writing to a String cannot fail
    }
    table
}

/// Formats line and distance of each outlier.
fn left_out(fitted: &CurveResult<'_>, unit: &str) -> String {
    let outliers = fitted.outliers();
    if outliers.is_empty() {
        return "no reading".to_owned();
    }
    let each =
        outliers.iter().map(|(line, distance)| format!("line {line} ({distance:+.4} {unit})"));
    format!(
        "{} of {}: {}",
        outliers.len(),
        fitted.measured.samples.len(),
        each.collect::<Vec<_>>().join(", ")
    )
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
    let joints = session.joints.iter().map(joint_json);
    serde_json::json!({
        "ok": session.joints.iter().all(|fitted| fitted.accepted().is_some()),
        "data": session.file,
        "provenance": session.data.provenance,
        "dates": session.data.dates,
        "unit": unit(session.data.is_force),
        "joints": joints.collect::<Vec<_>>(),
    })
}

fn joint_json(fitted: &CurveResult<'_>) -> serde_json::Value {
    let outliers = fitted.outliers();
    let outlier =
        |(line, distance): &(usize, f64)| serde_json::json!({ "line": line, "distance": distance });
    let mut joint = serde_json::json!({
        "joint": fitted.joint,
        "samples": fitted.measured.samples.len(),
        "accepted": fitted.accepted().is_some(),
        "reasons": fitted.reasons,
        "warnings": fitted.warnings,
        "outliers": outliers.iter().map(outlier).collect::<Vec<_>>(),
    });
    let curve = fitted.evidence.as_ref().map(curve_json);
    if let Some((joint, serde_json::Value::Object(curve))) = joint.as_object_mut().zip(curve) {
        joint.extend(curve);
    }
    joint
}

fn curve_json(evidence: &Evidence) -> serde_json::Value {
    let Evidence { fit, curve, before, .. } = evidence;
    let CurveFit { both, up, down, line, friction, is_reversed, unevenness, .. } = fit;
    let (least_slope, at) = curve.least_slope();
    serde_json::json!({
        "torque_curve": curve.coefficients(),
        "max_torque": curve.max_torque(),
        "motor_turns_against_joint": is_reversed,
        "monotone": { "least_slope_per_mille": least_slope, "at": at },
        "configured_off_rms_per_mille": before,
        "both": polynomial_json(both),
        "up": polynomial_json(up),
        "down": polynomial_json(down),
        "straight_line": polynomial_json(line),
        "friction": friction,
        "hysteresis": { "torque": friction.hysteresis(), "largest": friction.widest },
        "even_part": unevenness,
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
