//! Fitted torque curve of one joint, and the reasons to reject it.

use crate::calib::session::{CurveResult, Evidence};
use crate::calib::{fragment, report};
use calibration::fit::CurveFit;
use calibration::fit::doubt::Doubt;
use calibration::torque_data::JointReadings;
use config::{Actuator, JointParameters};
use controller::arm::JointKind;

/// Fits a curve to the samples of a joint, and checks it against the configuration.
pub(super) fn judge<'a>(
    joint: String,
    measured: &'a JointReadings,
    is_force: bool,
    configured: Option<&JointParameters>,
) -> CurveResult<'a> {
    let (evidence, reasons, warnings) = (None, Vec::new(), Vec::new());
    let mut fitted = CurveResult { joint, measured, evidence, reasons, warnings };
    if let Some(joint) = configured {
        fitted.reasons.extend(wrong_unit(is_force, joint));
    }
    let fit = match CurveFit::fit(&measured.samples) {
        Ok(fit) => fit,
        Err(error) => {
            fitted.reasons.push(error.to_string());
            return fitted;
        }
    };
    let curve = match fragment::written(&fit.curve) {
        Ok(curve) => curve,
        Err(error) => {
            fitted.reasons.push(error.to_string());
            return fitted;
        }
    };
    let line = straight_line(&fit, configured);
    let before =
        configured.and_then(|joint| fit.distance(&measured.samples, joint.calibration.curve()));
    fitted.evidence = Some(Evidence { fit, curve, before, line });
    doubt(&mut fitted, report::unit(is_force), configured);
    fitted
}

/// Adds the doubts that follow from the readings and from the configuration.
fn doubt(fitted: &mut CurveResult<'_>, unit: &str, configured: Option<&JointParameters>) {
    let Some(Evidence { fit, curve, .. }) = &fitted.evidence else { return };
    let against = configured.and_then(|joint| fit.doubt_against(joint.calibration.curve()));
    let doubts: Vec<Doubt> = fit.doubts().into_iter().chain(against).collect();
    let mut reasons: Vec<String> = doubts.iter().map(|doubt| doubt.reason(unit)).collect();
    let mut warnings = Vec::new();
    if let Some(joint) = configured {
        reasons.extend(wrong_direction(fit, joint));
        let needed = joint.calibration.curve().max_torque();
        if curve.max_torque() < needed && against.is_none() {
            warnings.push(format!(
                "range ±{} {unit} is below the configured {needed} {unit}; measure further, or lower it",
                curve.max_torque()
            ));
        }
    }
    if doubts.iter().any(|doubt| matches!(doubt, Doubt::Outliers { .. })) {
        let lines = fitted.outliers().into_iter().map(|(line, _)| line.to_string());
        reasons.push(format!("outliers are in lines {}", lines.collect::<Vec<_>>().join(", ")));
    }
    fitted.reasons.extend(reasons);
    fitted.warnings.extend(warnings);
}

/// Returns the reason to reject readings in the unit of the other kind of joint.
fn wrong_unit(is_force: bool, joint: &JointParameters) -> Option<String> {
    let (kind, column) = match joint.plant.link.kind {
        JointKind::Revolute => ("revolute", "torque_nm"),
        JointKind::Prismatic => ("prismatic", "force_n"),
    };
    let is_right = is_force == (joint.plant.link.kind == JointKind::Prismatic);
    (!is_right).then(|| format!("the joint is {kind}; its readings must be in a column {column}"))
}

/// Returns the reason to reject a motor whose direction differs from the configured one.
fn wrong_direction(fit: &CurveFit, joint: &JointParameters) -> Option<String> {
    let gear_ratio = joint.plant.actuator.gear_ratio;
    let motor = if fit.is_reversed { "against" } else { "with" };
    ((gear_ratio < 0.0) != fit.is_reversed)
        .then(|| format!("the motor turns {motor} the joint, but gear_ratio is {gear_ratio}"))
}

/// Returns the straight line for comparison: that of the data sheets, or else the fitted one.
fn straight_line(fit: &CurveFit, joint: Option<&JointParameters>) -> (&'static str, f64) {
    let [slope] = fit.line.coefficients;
    joint.map_or(("best straight line", slope), |joint| {
        // Nominal data of motor and gear: 1000 ‰ at their product.
        let Actuator { rated_torque, gear_ratio, .. } = joint.plant.actuator;
        ("manufacturer (rated × gear)", 1e3 / (rated_torque * gear_ratio.abs()))
    })
}
