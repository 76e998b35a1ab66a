//! A calibration rig: one drive whose joint is held against a load cell while its target torque goes
//! slowly up and down, as a laboratory measures a torque curve (4.2).
//!
//! The drive's own curve is drawn from a seed: nobody knows it but the rig. Friction holds the joint back,
//! so that what the cell reads differs between rising and falling commands; the cell is noisy.

use crate::sim::actuator::Actuator;
use crate::sim::actuator::ActuatorSettings;
use crate::sim::random::SplitMix;

/// Steps from nothing to the largest command.
const STEPS: i16 = 20;

/// Standard deviation of the cell, as a part of the largest torque.
const NOISE: f64 = 0.002;

/// What the rig is made of.
#[derive(Clone, Copy, Debug)]
pub struct RigSettings {
    /// The drive as it is configured; its curve is only where the unknown one begins.
    pub actuator: ActuatorSettings,
    /// Dry friction at the joint, in N·m or N.
    pub friction: f64,
    /// What the unknown curve and the noise are drawn from.
    pub seed: u64,
}

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The target torque, in ‰ of rated torque.
    pub per_mille: i16,
    /// What the cell says, in N·m or N.
    pub torque: f64,
    /// Whether the command was rising.
    pub rising: bool,
}

/// The drive with its unknown curve, and what was read.
#[derive(Clone, Debug)]
pub struct Run {
    /// c1, c3, c5 of the unknown curve, in ‰ per N·m, N·m³, N·m⁵.
    pub curve: [f64; 3],
    /// Up from the largest negative command to the largest positive one, and down again.
    pub readings: Vec<Reading>,
}

/// Draws the unknown curve and measures it.
pub fn measure(settings: &RigSettings) -> Run {
    let mut random = SplitMix(settings.seed);
    let actuator = unknown(settings.actuator, &mut random);
    let [c1, c3, c5] = actuator.torque_curve;
    let max = actuator.max_torque;
    let largest = max * (c1 + max * max * (c3 + max * max * c5));
    let mut drive = Actuator::new(actuator);
    let mut read = |step: i16, rising: bool| {
        let per_mille = whole(largest * f64::from(step) / f64::from(STEPS));
        let held_back = if rising { -settings.friction } else { settings.friction };
        let noise = NOISE * max * random.next_normal();
        Reading { per_mille, torque: drive.exert(per_mille) + held_back + noise, rising }
    };
    let up: Vec<Reading> = (-STEPS..=STEPS).map(|step| read(step, true)).collect();
    let down = (-STEPS..=STEPS).rev().map(|step| read(step, false));
    let readings = up.into_iter().chain(down).collect();
    Run { curve: actuator.torque_curve, readings }
}

/// The same drive with another curve: a slope up to a tenth off, and a bend that a straight line misses.
fn unknown(configured: ActuatorSettings, random: &mut SplitMix) -> ActuatorSettings {
    let [c1, c3, c5] = configured.torque_curve;
    let max = configured.max_torque;
    let end = c1 + max * max * (c3 + max * max * c5); // per mille per N·m at the end
    let slope = end * (0.8 + 0.2 * random.next());
    let bend = end * (-0.15 + 0.1 * random.next());
    let rest = end * (1.0 + 0.05 * random.next()) - slope - bend;
    let torque_curve = [slope, bend / (max * max), rest / max.powi(4)];
    ActuatorSettings { torque_curve, ..configured }
}

#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "saturates at the ends of i16; NaN becomes no command"
)]
fn whole(value: f64) -> i16 {
    value.round() as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(seed: u64) -> RigSettings {
        let actuator = ActuatorSettings {
            counts_per_rev: 16384.0,
            gear_ratio: -40.0,
            zero_counts: 0,
            rated_torque: 0.1765,
            torque_curve: [133.0, -0.4, 0.02],
            max_torque: 6.0,
        };
        RigSettings { actuator, friction: 0.06, seed }
    }

    #[test]
    fn every_seed_draws_a_curve_that_rises() {
        for seed in 0..500 {
            let [c1, c3, c5] = measure(&settings(seed)).curve;
            for step in 0..=600 {
                let t = f64::from(step) / 100.0;
                let slope = c1 + t * t * (3.0 * c3 + t * t * 5.0 * c5);
                assert!(slope > 0.0, "seed {seed}: {slope} at {t} N·m");
            }
        }
    }

    #[test]
    fn the_same_seed_reads_the_same_and_another_does_not() {
        let readings = |seed| measure(&settings(seed)).readings;
        assert_eq!(readings(7), readings(7));
        assert_ne!(readings(7), readings(8));
    }

    #[test]
    fn a_motor_that_turns_against_the_joint_pushes_it_back() {
        let readings = measure(&settings(1)).readings;
        assert_eq!(readings.len(), 82);
        let against = readings.iter().filter(|reading| reading.per_mille.abs() > 100);
        assert!(against.clone().count() > 50);
        assert!(against.into_iter().all(|r| f64::from(r.per_mille) * r.torque < 0.0));
    }
}
