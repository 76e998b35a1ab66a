//! Friction rig: one joint moved slowly through its range at constant velocities, up and down, and held in postures
//! that it reaches from both sides.
//!
//! The rig is not on a bus. Nothing accelerates, so the motor balances gravity and friction alone:
//!
//! ```text
//!  torque = gravity(q) + s dry(velocity) + viscous velocity      s: +1 up, -1 down; if held, by the approach
//! ```

use crate::actuator::{ActuatorSettings, TorqueCurve};
use crate::arm::{Arm, Joints};
use crate::plant::Resistance;
use crate::random::SplitMix;
use crate::rig::whole;

/// Moved part of the range, centred in it.
const PART: f64 = 0.8;
/// Time to move through the part at the fastest speed, in s.
const FASTEST: f64 = 2.0;
/// Speeds relative to the fastest.
const SPEEDS: [f64; 6] = [0.1, 0.2, 0.35, 0.5, 0.75, 1.0];
/// Readings of each speed and direction.
const READINGS: u16 = 12;
/// Number of held postures.
const POSTURES: u16 = 8;
/// Standard deviation of the torque, averaged over a plateau, relative to the capacity.
const NOISE: f64 = 0.0005;

/// Joint to sweep.
#[derive(Clone, Copy, Debug)]
pub struct FrictionRigSettings {
    /// Motor, gear and torque curve, as configured.
    pub actuator: ActuatorSettings,
    /// Index of the joint, from 0.
    pub joint: usize,
    /// Friction and range; the seed changes the Coulomb and the viscous part.
    pub resistance: Resistance,
    /// Positions of all joints, in rad or m; only joint `joint` moves.
    pub start: Joints,
}

/// Reading at a constant velocity, or at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowReading {
    /// Velocity of the joint in rad/s or m/s; zero if held.
    pub velocity: f64,
    /// Set if the joint moves up, or moved up before it was held.
    pub is_rising: bool,
    /// Actual torque (6077h), in ‰ of rated torque.
    pub per_mille: i16,
    /// Positions of all joints, in rad or m.
    pub q: Joints,
}

/// Rig of one joint.
#[derive(Clone, Copy, Debug)]
pub struct FrictionRig {
    arm: Arm,
    settings: FrictionRigSettings,
    curve: TorqueCurve,
    resistance: Resistance,
    random: SplitMix,
}

impl FrictionRig {
    /// Creates a joint of `arm` whose friction the seed makes 10 to 30 % larger or smaller than in `settings`.
    pub fn new(arm: Arm, settings: FrictionRigSettings, seed: u64) -> Self {
        let mut random = SplitMix::new(seed);
        let configured = settings.resistance;
        let [coulomb, viscous] = [configured.coulomb, configured.viscous].map(|configured| {
            let amount = 0.1 + 0.2 * random.unit();
            configured * if random.unit() < 0.5 { 1.0 - amount } else { 1.0 + amount }
        });
        let curve = TorqueCurve::new(&settings.actuator);
        Self {
            arm,
            settings,
            curve,
            resistance: Resistance { coulomb, viscous, ..configured },
            random,
        }
    }

    /// Returns Coulomb and viscous friction: the result expected of a fit.
    pub const fn friction(&self) -> [f64; 2] {
        [self.resistance.coulomb, self.resistance.viscous]
    }

    /// Returns the standard deviation of the torque, in N·m or N.
    pub fn noise(&self) -> f64 {
        NOISE * self.settings.actuator.max_torque
    }

    /// Sweeps at each speed up and down, then holds postures approached from both sides. Positions where the motor is too
    /// weak are left out.
    pub fn measure(mut self) -> Vec<SlowReading> {
        let [low, high] = self.resistance.range;
        let fastest = PART * (high - low) / FASTEST;
        let speeds = SPEEDS.map(|part| part * fastest);
        let moving =
            speeds.into_iter().flat_map(|speed| [(speed, 1.0, READINGS), (speed, -1.0, READINGS)]);
        let passes = moving.chain([(0.0, 1.0, POSTURES), (0.0, -1.0, POSTURES)]);
        let mut readings = Vec::new();
        for (speed, direction, places) in passes.collect::<Vec<_>>() {
            for place in 0..places {
                let part = f64::from(place) / f64::from(places.saturating_sub(1).max(1));
                let middle = f64::midpoint(low, high);
                let position = middle + direction * (part - 0.5) * PART * (high - low);
                readings.extend(self.reading(position, speed, direction));
            }
        }
        readings
    }

    /// Returns the reading of the drive at a position; `None` where the motor is too weak.
    fn reading(&mut self, position: f64, speed: f64, direction: f64) -> Option<SlowReading> {
        let mut q = self.settings.start;
        *q.get_mut(self.settings.joint)? = position;
        let gravity = *self.arm.gravity(&self.arm.posture(&q)).get(self.settings.joint)?;
        let friction = self.resistance.dry(speed) + self.resistance.viscous * speed;
        let torque = gravity + direction * friction;
        let torque = torque + self.noise() * self.random.normal();
        let is_able = torque.abs() < self.settings.actuator.max_torque;
        is_able.then(|| SlowReading {
            velocity: if speed > 0.0 { direction * speed } else { 0.0 },
            is_rising: direction > 0.0,
            per_mille: whole(self.curve.target(torque)),
            q,
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Vector3};

    use super::*;
    use crate::arm::{ArmSettings, LinkSettings};

    /// Returns a rig whose last joint lifts 1 kg on an arm of 0.1 m; the others do nothing.
    fn rig(seed: u64, stiction: f64) -> FrictionRig {
        let link = LinkSettings {
            is_prismatic: false,
            alpha: 0.0,
            a: 0.0,
            d: 0.0,
            theta: 0.0,
            mass: 0.0,
            centre_of_mass: Vector3::zeros(),
            inertia: Matrix3::zeros(),
            rotor_inertia: 0.001,
        };
        let mut links = [link; 6];
        links[5] = LinkSettings { mass: 1.0, centre_of_mass: Vector3::new(0.1, 0.0, 0.0), ..link };
        let gravity = Vector3::new(0.0, -9.81, 0.0);
        let settings = FrictionRigSettings {
            actuator: ActuatorSettings {
                counts_per_rev: 16_384.0,
                gear_ratio: -40.0,
                zero_counts: 0,
                rated_torque: 0.1765,
                torque_curve: [133.144, -0.393_453, 0.019_672_6],
                max_torque: 6.0,
            },
            joint: 5,
            resistance: Resistance { coulomb: 0.06, stiction, viscous: 0.024, range: [-1.0, 1.0] },
            start: Joints::zeros(),
        };
        FrictionRig::new(
            Arm::new(ArmSettings { links, x_6_g: Isometry3::identity(), gravity }),
            settings,
            seed,
        )
    }

    #[test]
    fn readings_balance_gravity_and_friction() {
        for seed in 0..20 {
            let rig = rig(seed, 0.0);
            let [coulomb, viscous] = rig.friction();
            assert!((0.09..=0.31).contains(&(coulomb / 0.06 - 1.0).abs()), "{coulomb}");
            assert!((0.09..=0.31).contains(&(viscous / 0.024 - 1.0).abs()), "{viscous}");
            let readings = rig.measure();
            assert_eq!(readings.len(), 2 * (6 * 12 + 8));
            for SlowReading { velocity, is_rising, per_mille, q } in readings {
                let sign = if is_rising { 1.0 } else { -1.0 };
                let torque = 0.981 * q[5].cos() + sign * coulomb + viscous * velocity;
                let reported = rig.curve.torque(f64::from(per_mille));
                assert!(
                    (reported - torque).abs() < 6.0 * rig.noise() + 0.004,
                    "{reported} {torque}"
                );
                assert!(q[5].abs() <= 0.8 + 1e-12 && velocity * sign >= 0.0);
            }
        }
    }

    #[test]
    fn held_postures_are_reached_from_both_sides() {
        let held: Vec<SlowReading> = rig(1, 0.0)
            .measure()
            .into_iter()
            .filter(|reading| reading.velocity.abs() <= 0.0)
            .collect();
        let (up, down): (Vec<&SlowReading>, Vec<_>) = held.iter().partition(|r| r.is_rising);
        // Eight postures of 80 % of the range, -1 to 1, each from below and from above.
        let expected: Vec<f64> = (0..8).map(|place| 0.8 * (f64::from(place) / 3.5 - 1.0)).collect();
        for (side, sign) in [(up, 1.0), (down, -1.0)] {
            let mut found: Vec<f64> = side.iter().map(|reading| reading.q[5]).collect();
            found.sort_by(f64::total_cmp);
            assert_eq!(found.len(), expected.len());
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
            // Friction holds against the side it came from.
            let rig = rig(1, 0.0);
            let [coulomb, _] = rig.friction();
            for reading in side {
                let torque =
                    rig.curve.torque(f64::from(reading.per_mille)) - 0.981 * reading.q[5].cos();
                assert!((sign * torque - coulomb).abs() < 6.0 * rig.noise() + 0.004, "{torque}");
            }
        }
    }

    #[test]
    fn static_friction_holds_more_than_moves() {
        let torque = |stiction: f64, velocity: f64| {
            let rig = rig(1, stiction);
            let found = rig.measure().into_iter().filter(|r| (r.velocity - velocity).abs() < 1e-9);
            let first = found.into_iter().find(|reading| reading.is_rising).unwrap();
            rig.curve.torque(f64::from(first.per_mille))
        };
        // A target of 1 ‰ is 0.0075 N·m.
        assert!((torque(0.1, 0.0) - torque(0.0, 0.0) - 0.1).abs() < 0.008);
        assert!((torque(0.1, 0.8) - torque(0.0, 0.8)).abs() < 1e-9);
    }

    #[test]
    fn seed_determines_the_readings() {
        assert_eq!(rig(3, 0.0).measure(), rig(3, 0.0).measure());
        assert_ne!(rig(3, 0.0).measure(), rig(4, 0.0).measure());
    }
}
