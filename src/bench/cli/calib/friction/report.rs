//! Report of `frhc calib friction` on every joint, as text and JSON.

use crate::calib::friction::judgement::{FrictionResult, Gravity};
use calibration::fit::sweep::{Estimate, JointFriction, Law};
use units::wording::counted;

/// Returns a table for every joint.
pub(super) fn text(joints: &[FrictionResult<'_>]) -> String {
    joints.iter().map(joint_text).collect::<Vec<_>>().join("\n\n")
}

fn joint_text(judged: &FrictionResult<'_>) -> String {
    let [unit, _] = judged.units();
    let mut lines = vec![format!("{}: {}", judged.name(), origin(judged))];
    if let Some(friction) = &judged.friction {
        lines.extend(table(judged, friction));
        lines.push(String::new());
        lines.push(format!("  load         {}", load(judged, friction)));
    }
    lines.extend(
        judged.gravity.iter().map(|gravity| format!("  gravity      {}", held(judged, gravity))),
    );
    if judged.friction.is_some() {
        lines.push(format!("  left out     {}", left_out(judged, unit)));
    }
    for (kind, notes) in [("warning:", &judged.warnings), ("rejected:", &judged.reasons)] {
        lines.extend(notes.iter().map(|note| format!("  {kind:12} {note}")));
    }
    lines.join("\n")
}

/// Returns files and numbers of readings.
pub(super) fn origin(judged: &FrictionResult<'_>) -> String {
    let (moving, held) = (judged.swept.moving.len(), judged.swept.held.len());
    format!("{}: {} in motion, {held} held", judged.swept.files(), counted(moving, "reading"))
}

fn table(judged: &FrictionResult<'_>, friction: &JointFriction) -> Vec<String> {
    let [unit, viscous_unit] = judged.units();
    let head = |first: &str, coulomb: &str, viscous: &str, rms: &str, count: &str| {
        format!("  {first:16}{coulomb:>20}{viscous:>24}{rms:>12}{count:>10}")
    };
    let places = decimals(judged);
    let estimate = |estimate: &Estimate| {
        format!("{:.places$} ± {:.places$}", estimate.value, estimate.deviation)
    };
    let row = |name: &str, law: &Law| {
        let (rms, count) = (format!("{:.places$}", law.rms), law.readings.to_string());
        head(name, &estimate(&law.coulomb), &estimate(&law.viscous), &rms, &count)
    };
    let configured = judged.swept.parameters.plant.friction;
    let [coulomb, viscous] =
        [configured.coulomb, configured.viscous].map(|value| value.to_string());
    vec![
        head(
            "friction",
            &format!("Coulomb {unit}"),
            &format!("viscous {viscous_unit}"),
            &format!("RMS {unit}"),
            "readings",
        ),
        row("moving up", &friction.up),
        row("moving down", &friction.down),
        row("both directions", &friction.both),
        head("configured", &coulomb, &viscous, "", "").trim_end().to_owned(),
    ]
}

/// Returns the decimals that show Coulomb friction with four digits.
fn decimals(judged: &FrictionResult<'_>) -> usize {
    let coulomb =
        judged.friction.as_ref().map_or(1.0, |friction| friction.both.coulomb.value.abs());
    (1..8_u8).find(|places| coulomb * 10_f64.powi((*places).into()) >= 1e3).unwrap_or(8).into()
}

/// Formats the constant torque in addition to friction.
fn load(judged: &FrictionResult<'_>, friction: &JointFriction) -> String {
    let [unit, _] = judged.units();
    let (Estimate { value, deviation }, places) = (friction.load, decimals(judged));
    let share = 100.0 * value.abs() / judged.capacity();
    let besides = if judged.swept.has_gravity { "besides gravity" } else { "with gravity" };
    format!(
        "{value:+.places$} ± {deviation:.places$} {unit} {besides}, {share:.1} % of the capacity"
    )
}

/// Formats the comparison of held postures with gravity.
fn held(judged: &FrictionResult<'_>, gravity: &Gravity) -> String {
    let [unit, _] = judged.units();
    let places = decimals(judged);
    let Gravity { postures, rms, largest, share, at, friction } = gravity;
    let percent = 100.0 * share;
    format!(
        "{postures} held postures off by {rms:.places$} {unit} RMS, {largest:+.places$} {unit} at most ({percent:.1} % of the capacity, \
         line {}); friction at rest {friction:.places$} {unit}",
        at.line
    )
}

/// Formats place and distance of each outlier.
fn left_out(judged: &FrictionResult<'_>, unit: &str) -> String {
    let outliers = judged.outliers();
    if outliers.is_empty() {
        return "no reading".to_owned();
    }
    let places = decimals(judged);
    let each = outliers.iter().map(|(source, distance)| {
        format!("{}:{} ({distance:+.places$} {unit})", source.file, source.line)
    });
    let each: Vec<String> = each.collect();
    format!("{} of {}: {}", outliers.len(), judged.swept.moving.len(), each.join(", "))
}

/// Returns the report as one JSON object.
pub(super) fn json(joints: &[FrictionResult<'_>]) -> serde_json::Value {
    serde_json::json!({
        "ok": joints.iter().all(|judged| judged.accepted().is_some()),
        "joints": joints.iter().map(joint_json).collect::<Vec<_>>(),
    })
}

fn joint_json(judged: &FrictionResult<'_>) -> serde_json::Value {
    let [unit, viscous_unit] = judged.units();
    let configured = judged.swept.parameters.plant.friction;
    let outliers = judged.outliers().into_iter().map(|(source, distance)| {
        serde_json::json!({ "file": source.file, "line": source.line, "distance": distance })
    });
    let friction = judged.friction.as_ref();
    serde_json::json!({
        "joint": judged.name(),
        "files": judged.swept.files(),
        "unit": unit,
        "viscous_unit": viscous_unit,
        "accepted": judged.accepted().is_some(),
        "reasons": judged.reasons,
        "warnings": judged.warnings,
        "up": friction.map(|friction| friction.up),
        "down": friction.map(|friction| friction.down),
        "both": friction.map(|friction| friction.both),
        "load": friction.map(|friction| friction.load),
        "gravity_subtracted": judged.swept.has_gravity,
        "gravity": judged.gravity,
        "configured": { "coulomb": configured.coulomb, "viscous": configured.viscous },
        "outliers": outliers.collect::<Vec<_>>(),
    })
}
