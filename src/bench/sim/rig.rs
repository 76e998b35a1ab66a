//! Calibration rig: one joint against a load cell, driven slowly up and down to measure its torque curve (4.2).
//!
//! Not on a bus; the joint is at rest between two targets. The load cell yields a little, so the joint follows the
//! motor, and dry friction opposes it:
//!
//! ```text
//!  reading = clamp(previous reading, t - c, t + c)    t: motor torque, c: dry friction
//! ```

use crate::actuator::{ActuatorSettings, TorqueCurve};
use crate::random::SplitMix;

/// Measured range relative to the maximum joint torque: the calibrated range must contain it.
const RANGE_RATIO: f64 = 1.05;
/// Range of the simulated motor relative to the maximum joint torque.
const MOTOR_RANGE_RATIO: f64 = 1.25;
/// Readings per sweep.
const STEPS: i16 = 40;
/// Number of sweeps: twice in each direction.
const SWEEPS: i16 = 4;
/// Standard deviation of the load cell, relative to its full scale.
const NOISE: f64 = 0.002;

/// One reading of the load cell, at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Set if the joint torque rose before this reading.
    pub is_rising: bool,
    /// Target torque, in ‰ of rated torque.
    pub per_mille: i16,
    /// Load cell value, in N·m at the joint.
    pub torque: f64,
}

/// Joint at its load cell.
#[derive(Clone, Copy, Debug)]
pub struct Rig {
    settings: ActuatorSettings,
    curve: TorqueCurve,
    coulomb: f64,
    full_scale: f64,
    random: SplitMix,
    per_mille: i16,
    /// True load of the load cell, in N·m.
    load: f64,
}

impl Rig {
    /// Creates a joint as in `settings` with dry friction `coulomb` in N·m, but with a torque curve chosen by the seed.
    pub fn new(settings: ActuatorSettings, coulomb: f64, seed: u64) -> Self {
        let mut random = SplitMix::new(seed);
        let settings = ActuatorSettings {
            torque_curve: random_curve(&settings, &mut random),
            max_torque: MOTOR_RANGE_RATIO * settings.max_torque,
            ..settings
        };
        let full_scale = settings.max_torque / MOTOR_RANGE_RATIO * RANGE_RATIO;
        let curve = TorqueCurve::new(&settings);
        Self { settings, curve, coulomb, full_scale, random, per_mille: 0, load: 0.0 }
    }

    /// Returns c1, c3, c5 of the curve: the result expected of a calibration.
    pub const fn torque_curve(&self) -> [f64; 3] {
        self.settings.torque_curve
    }

    /// Returns the standard deviation of the load cell, in N·m.
    pub fn noise(&self) -> f64 {
        NOISE * self.full_scale
    }

    /// Drives to one end, then twice from end to end and back, with a reading at each step.
    pub fn measure(mut self) -> Vec<Reading> {
        let end = self.find_end();
        let mut readings = Vec::new();
        for sweep in 0..SWEEPS {
            let is_rising = sweep % 2 == 1;
            for step in 1..=STEPS {
                let part = 2.0 * f64::from(step) / f64::from(STEPS) - 1.0;
                let part = if is_rising { part } else { -part };
                let target = whole(part * f64::from(end));
                self.drive_to(target);
                let torque = self.load + self.noise() * self.random.normal();
                readings.push(Reading { is_rising, per_mille: target, torque });
            }
        }
        readings
    }

    /// Raises the torque to the full scale of the load cell; returns the target there.
    fn find_end(&mut self) -> i16 {
        let towards = whole(f64::from(i16::MAX) * self.settings.gear_ratio.signum());
        while self.load < self.full_scale && self.per_mille != towards {
            self.step_towards(towards);
        }
        self.per_mille
    }

    /// Changes the target slowly, by one per mille at a time.
    fn drive_to(&mut self, target: i16) {
        while self.per_mille != target {
            self.step_towards(target);
        }
    }

    fn step_towards(&mut self, target: i16) {
        self.per_mille = self.per_mille.saturating_add((target > self.per_mille).into());
        self.per_mille = self.per_mille.saturating_sub((target < self.per_mille).into());
        let torque = self.curve.torque(f64::from(self.per_mille));
        self.load = self.load.clamp(torque - self.coulomb, torque + self.coulomb);
    }
}

/// Returns an odd curve, 10 to 30 % steeper or flatter at zero than that of `settings`, with another bend. With
/// `u = t / max` its slope is `c1 (1 + 3 a u² + 5 b u⁴)`, with a minimum at `u² = -3 a / (10 b)` of at least 0.73 c1.
fn random_curve(settings: &ActuatorSettings, random: &mut SplitMix) -> [f64; 3] {
    let [c1, ..] = settings.torque_curve;
    let amount = 0.1 + 0.2 * random.unit();
    let c1 = c1 * if random.unit() < 0.5 { 1.0 - amount } else { 1.0 + amount };
    let a = -0.3 + 0.2 * random.unit();
    let b = 0.15 + 0.3 * random.unit();
    let square = settings.max_torque * settings.max_torque;
    [c1, c1 * a / square, c1 * b / (square * square)]
}

/// Rounds to i16; saturates.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "saturates at the ends of i16"
)]
pub(super) fn whole(value: f64) -> i16 {
    value.round() as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig(gear_ratio: f64, seed: u64) -> Rig {
        let settings = ActuatorSettings {
            counts_per_rev: 16_384.0,
            gear_ratio,
            zero_counts: 0,
            rated_torque: 0.1765,
            torque_curve: [133.144, -0.393_453, 0.019_672_6],
            max_torque: 6.0,
        };
        Rig::new(settings, 0.06, seed)
    }

    #[test]
    fn seed_determines_the_curve() {
        assert_eq!(rig(40.0, 3).measure(), rig(40.0, 3).measure());
        assert_ne!(rig(40.0, 3).measure(), rig(40.0, 4).measure());
    }

    #[test]
    fn random_curves_rise_over_the_motor_range() {
        for seed in 0..1_000 {
            let [c1, c3, c5] = rig(40.0, seed).torque_curve();
            for step in 0..=100 {
                let s = (7.5 * f64::from(step) / 100.0_f64).powi(2);
                assert!(c1 + 3.0 * c3 * s + 5.0 * c5 * s * s > 0.729 * c1, "seed {seed}");
            }
        }
    }

    #[test]
    fn readings_are_within_friction_and_noise_of_the_curve() {
        for gear_ratio in [40.0, -40.0] {
            let rig = rig(gear_ratio, 5);
            let [c1, c3, c5] = rig.torque_curve();
            for reading in rig.measure() {
                let curve = rig.curve;
                let torque = curve.torque(f64::from(reading.per_mille));
                let back = c1 * torque + c3 * torque.powi(3) + c5 * torque.powi(5);
                assert!((back * gear_ratio.signum() - f64::from(reading.per_mille)).abs() < 1e-6);
                assert!((reading.torque - torque).abs() < 0.06 + 6.0 * rig.noise());
            }
        }
    }

    #[test]
    fn friction_separates_rising_and_falling_readings() {
        let readings = rig(40.0, 1).measure();
        let mean = |is_rising: bool| {
            let of = readings.iter().filter(|reading| reading.is_rising == is_rising);
            of.map(|reading| reading.torque).sum::<f64>() / 80.0
        };
        // A sweep starts at the end of the other: the difference lacks a step, 1/40 of the range.
        let shift = mean(false) - mean(true) + 2.0 * 6.3 / 40.0;
        assert!((shift - 0.12).abs() < 0.02, "{shift}");
    }

    #[test]
    fn range_is_measured_to_both_ends() {
        for seed in 0..20 {
            let readings = rig(-40.0, seed).measure();
            for is_rising in [true, false] {
                let torques = readings.iter().filter(|r| r.is_rising == is_rising);
                let torques: Vec<f64> = torques.map(|reading| reading.torque).collect();
                assert!(torques.iter().copied().fold(0.0, f64::max) > 5.8);
                assert!(torques.iter().copied().fold(0.0, f64::min) < -5.8);
            }
        }
    }
}
