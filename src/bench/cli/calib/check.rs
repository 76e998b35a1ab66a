//! `frhc calib check`: properties of the torque curves of a configuration, which loads only with monotone curves.

use serde::Serialize;

use crate::calib::Check;
use config::{Config, JointParameters};
use controller::arm::JointKind;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use telemetry::digits::significant;

/// Properties of one torque curve.
#[derive(Serialize)]
struct Finding<'a> {
    joint: &'a str,
    monotone: bool,
    /// Unit of torques: N·m, or N for a prismatic joint.
    unit: &'static str,
    max_torque: f64,
    /// Smallest slope in ‰ per unit.
    least_slope_per_mille: f64,
    /// Torque of the smallest slope.
    least_slope_at: f64,
    /// Torque of one step of 6071h near zero.
    resolution: f64,
    /// Target at the end of the range (6072h), in ‰.
    max_target_per_mille: i16,
    /// Ratio of the largest value of 6071h (16 bits) to the target at the end of the range.
    i16_margin: f64,
}

/// Loads the configuration, which rejects curves that are not monotone, and prints their properties.
pub(super) fn run(args: &Check) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    let findings = config.joints.iter().map(Finding::new);
    if args.json {
        let joints: Vec<_> = findings.collect();
        print::line(&serde_json::json!({ "ok": true, "joints": joints }).to_string());
    } else {
        print::line(&format!("{}: every torque curve is monotone", args.config.config.display()));
        findings.for_each(|finding| print::line(&finding.line()));
    }
    Ok(())
}

impl<'a> Finding<'a> {
    fn new(joint: &'a JointParameters) -> Self {
        let curve = joint.calibration.curve();
        let (least_slope_per_mille, least_slope_at) = curve.least_slope();
        let max_target_per_mille = joint.calibration.max_target().0;
        Self {
            joint: &joint.name,
            monotone: true,
            unit: match joint.plant.link.kind {
                JointKind::Revolute => "N·m",
                JointKind::Prismatic => "N",
            },
            max_torque: curve.max_torque(),
            least_slope_per_mille,
            least_slope_at,
            resolution: joint.calibration.resolution(),
            max_target_per_mille,
            i16_margin: f64::from(i16::MAX) / f64::from(max_target_per_mille),
        }
    }

    fn line(&self) -> String {
        let (unit, at) = (self.unit, self.least_slope_at);
        format!(
            "joint {:16} up to ±{} {unit}, slope at least {} ‰/{unit} (at {at:.2} {unit}), {:.4} {unit} per \
             step, 6072h {} ‰, i16 range is {:.0} times that",
            self.joint,
            self.max_torque,
            significant(self.least_slope_per_mille, 5),
            self.resolution,
            self.max_target_per_mille,
            self.i16_margin,
        )
    }
}
