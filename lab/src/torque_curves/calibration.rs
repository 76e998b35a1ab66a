//! One joint on the calibration rig: its readings, the maker's and the fitted curve, and the torque error of both.

use serde::Serialize;
use thiserror::Error;

use crate::pool;
use calibration::fit::{CurveFit, Direction, NoTorqueCurve, Sample};
use config::{Actuator, Config, JointParameters};
use controller::arm::JointKind;
use controller::calibration::{InvalidTorqueCurve, TorqueCurve};
use sim::rig::{Reading, Rig};
use testbench::world;

/// Torques over the range at which errors are taken.
const STEPS: i32 = 100;

/// Distance of the seeds of neighbouring joints of an arm.
const SEED_STEP: u64 = 1_000;

/// Curves of one joint: that of the simulated motor, and the two that a controller may use.
#[derive(Clone, Debug)]
pub struct JointCurves {
    /// Readings of the load cell.
    pub samples: Vec<Sample>,
    /// True curve of the motor.
    pub truth: TorqueCurve,
    /// Straight line of the data sheet: rated torque times gear ratio.
    pub line: TorqueCurve,
    /// Polynomial fitted to the readings.
    pub fitted: TorqueCurve,
    /// Dry friction from the same fit, in N·m or N.
    pub friction: f64,
    /// Set if the motor turns against the joint.
    pub is_reversed: bool,
}

/// Reason why a joint has no calibration.
#[derive(Debug, Error)]
#[error("joint {joint}: {reason}")]
pub struct NoJointCurves {
    joint: String,
    reason: Reason,
}

#[derive(Debug, Error)]
enum Reason {
    #[error("the data sheet's line: {0}")]
    Line(InvalidTorqueCurve),
    #[error("the motor's curve: {0}")]
    Truth(InvalidTorqueCurve),
    #[error("{0}")]
    Fit(#[from] NoTorqueCurve),
    #[error("the fitted curve: {0}")]
    Fitted(InvalidTorqueCurve),
}

/// Error of the torques that a curve commands, in percent of the end of the range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TorqueError {
    /// RMS over the range.
    pub rms: f64,
    /// Maximum over the range.
    pub max: f64,
    /// RMS error of the load cell's readings while the torque rose: with friction.
    pub rising: f64,
    /// RMS error of the load cell's readings while the torque fell.
    pub falling: f64,
}

/// Errors of both curves of one joint.
#[derive(Clone, Debug, Serialize)]
pub struct CurveErrors {
    /// Name of the configuration.
    pub config: String,
    /// Name of the joint.
    pub joint: String,
    /// Seed of the motors.
    pub seed: u64,
    /// Units are N instead of N·m: a prismatic joint.
    pub is_force: bool,
    /// End of the range, in N·m or N.
    pub range: f64,
    /// Fitted dry friction, in N·m or N.
    pub friction: f64,
    /// Error of the maker's line.
    pub line: TorqueError,
    /// Error of the fitted polynomial.
    pub polynomial: TorqueError,
}

impl JointCurves {
    /// Measures a joint on the rig and fits its curve.
    ///
    /// # Errors
    /// Returns an error if one of the curves does not rise, or the readings do not determine it.
    pub fn measure(joint: &JointParameters, seed: u64) -> Result<Self, NoJointCurves> {
        let no_curves = |reason| NoJointCurves { joint: joint.name.clone(), reason };
        let Actuator { rated_torque, gear_ratio, max_torque, .. } = joint.plant.actuator;
        let coulomb = joint.plant.friction.coulomb;
        let rig = Rig::new(world::actuator(&joint.plant.actuator), coulomb, seed);
        let truth = TorqueCurve::new(rig.torque_curve(), max_torque);
        // Nominal data of motor and gear: 1000 ‰ at their product.
        let line = [1e3 / (rated_torque * gear_ratio.abs()), 0.0, 0.0];
        let samples: Vec<Sample> = rig.measure().into_iter().map(sample).collect();
        let fit = CurveFit::fit(&samples).map_err(|error| no_curves(error.into()))?;
        let range = fit.curve.max_torque().min(max_torque);
        let fitted = TorqueCurve::new(fit.curve.coefficients(), range);
        Ok(Self {
            samples,
            truth: truth.map_err(|error| no_curves(Reason::Truth(error)))?,
            line: TorqueCurve::new(line, max_torque)
                .map_err(|error| no_curves(Reason::Line(error)))?,
            fitted: fitted.map_err(|error| no_curves(Reason::Fitted(error)))?,
            friction: fit.friction.torque,
            is_reversed: fit.is_reversed,
        })
    }

    /// Measures all joints of a configuration.
    ///
    /// # Errors
    /// Returns the error of [`measure`](Self::measure) for the first joint that fails.
    pub fn measure_all(config: &Config, seed: u64) -> Result<Vec<Self>, NoJointCurves> {
        let seeds = (0..).map(|place: u64| seed.wrapping_add(SEED_STEP.wrapping_mul(place)));
        config.joints.iter().zip(seeds).map(|(joint, seed)| Self::measure(joint, seed)).collect()
    }

    /// Returns the errors of both curves.
    pub fn row(&self, config: &str, joint: &JointParameters, seed: u64) -> CurveErrors {
        CurveErrors {
            config: config.to_owned(),
            joint: joint.name.clone(),
            seed,
            is_force: joint.plant.link.kind == JointKind::Prismatic,
            range: self.truth.max_torque(),
            friction: self.friction,
            line: self.error(&self.line),
            polynomial: self.error(&self.fitted),
        }
    }

    /// Returns the target of a sample in ‰ of rated torque, with the sign of its torque.
    pub fn target(&self, sample: &Sample) -> f64 {
        if self.is_reversed { -sample.per_mille } else { sample.per_mille }
    }

    /// Returns the error of the torques that `curve` commands.
    fn error(&self, curve: &TorqueCurve) -> TorqueError {
        let end = self.truth.max_torque();
        let errors: Vec<f64> = (1..=STEPS)
            .map(|step| end * f64::from(step) / f64::from(STEPS))
            .map(|torque| self.truth.torque(curve.at(torque)) - torque)
            .collect();
        let percent = 100.0 / end;
        let of_readings = |direction: Direction| {
            let readings = self.samples.iter().filter(|sample| sample.direction == direction);
            let within = readings.filter(|sample| sample.torque.abs() <= end);
            let errors = within.map(|sample| sample.torque - curve.torque(self.target(sample)));
            percent * pool::rms(&errors.collect::<Vec<_>>())
        };
        TorqueError {
            rms: percent * pool::rms(&errors),
            max: percent * pool::max(errors.iter().map(|error| error.abs())),
            rising: of_readings(Direction::Up),
            falling: of_readings(Direction::Down),
        }
    }
}

fn sample(Reading { is_rising, per_mille, torque }: Reading) -> Sample {
    let direction = if is_rising { Direction::Up } else { Direction::Down };
    Sample { torque, per_mille: per_mille.into(), direction }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn polynomial_is_right_where_the_line_is_not() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        for seed in 1..=3 {
            let measured = JointCurves::measure_all(&config, seed).unwrap();
            for (curves, joint) in measured.iter().zip(&config.joints) {
                let CurveErrors { line, polynomial, range, friction, .. } =
                    curves.row("", joint, seed);
                assert!(line.rms > 10.0 * polynomial.rms, "{}, seed {seed}: {line:?}", joint.name);
                assert!(polynomial.max < 1.0, "{}, seed {seed}: {polynomial:?}", joint.name);
                let known = joint.plant.friction.coulomb;
                assert!((friction - known).abs() < 0.002 * range, "{friction} of {known}");
                // Friction is all that separates the directions from the polynomial.
                let share = 100.0 * known / range;
                for direction in [polynomial.rising, polynomial.falling] {
                    assert!((direction - share).abs() < 0.5, "{direction} % of {share} %");
                }
            }
        }
    }
}
