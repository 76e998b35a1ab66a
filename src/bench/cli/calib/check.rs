//! `frhc calib check`: properties of the torque curves of a configuration, whose loading has proven them monotone.

use crate::calib::Check;
use config::{Config, JointParameters};
use controller::arm::JointKind;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use telemetry::digits::significant;

/// Properties of one torque curve.
struct Finding<'a> {
    joint: &'a str,
    /// N·m, or N for a prismatic joint.
    unit: &'static str,
    max_torque: f64,
    /// Smallest slope in ‰ per unit, and the torque at which it occurs.
    least_slope: (f64, f64),
    /// Torque of one step of 6071h near zero.
    resolution: f64,
    /// Target at the end of the range (6072h), in ‰.
    max_target: i16,
}

/// Loads the configuration, which rejects curves that are not monotone, and prints their properties.
pub(super) fn run(args: &Check) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    let findings = config.joints.iter().map(Finding::of);
    if args.json {
        let joints: Vec<_> = findings.map(|finding| finding.json()).collect();
        print::line(&serde_json::json!({ "ok": true, "joints": joints }).to_string());
    } else {
        print::line(&format!("{}: every torque curve is monotone", args.config.config.display()));
        findings.for_each(|finding| print::line(&finding.line()));
    }
    Ok(())
}

impl<'a> Finding<'a> {
    fn of(joint: &'a JointParameters) -> Self {
        let curve = joint.calibration.curve();
        Self {
            joint: &joint.name,
            unit: match joint.plant.link.kind {
                JointKind::Revolute => "N·m",
                JointKind::Prismatic => "N",
            },
            max_torque: curve.max_torque(),
            least_slope: curve.least_slope(),
            resolution: joint.calibration.resolution(),
            max_target: joint.calibration.max_target().0,
        }
    }

    /// Ratio of the largest value of 6071h (16 bits) to the largest target.
    fn margin(&self) -> f64 {
        f64::from(i16::MAX) / f64::from(self.max_target)
    }

    fn line(&self) -> String {
        let (unit, (slope, at)) = (self.unit, self.least_slope);
        format!(
            "joint {:16} up to ±{} {unit}, slope at least {} ‰/{unit} (at {at:.2} {unit}), {:.4} {unit} per \
             step, 6072h {} ‰, i16 range is {:.0} times that",
            self.joint,
            self.max_torque,
            significant(slope, 5),
            self.resolution,
            self.max_target,
            self.margin(),
        )
    }

    fn json(&self) -> serde_json::Value {
        let (slope, at) = self.least_slope;
        serde_json::json!({
            "joint": self.joint,
            "monotone": true,
            "unit": self.unit,
            "max_torque": self.max_torque,
            "least_slope_per_mille": slope,
            "least_slope_at": at,
            "resolution": self.resolution,
            "max_target_per_mille": self.max_target,
            "i16_margin": self.margin(),
        })
    }
}
