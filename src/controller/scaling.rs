//! Scales of motion, rotation and force that the operator sets while the arm runs, and locked axes.
//!
//! Each is a factor on a gain: per axis on K_V and K_P, and on K_T as a whole. The factor of a locked axis is zero. Factors
//! reach new values on a linear ramp of [`RAMP_S`]. The reference changes with them
//! ([`CommandLaw::reference`](crate::command::CommandLaw::reference)), so that the commanded pose does not jump.

use serde::Serialize;

use crate::gains::MAX_GAIN;
use crate::period::Period;
use units::adjustment::{LockAxis, Quantity};

/// Duration of the ramp to new factors, in s.
pub const RAMP_S: f64 = 0.5;

/// Dimensionless scale of each quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Scale {
    /// Factor on commanded translations.
    pub motion: f64,
    /// Factor on commanded rotations.
    pub rotation: f64,
    /// Factor on the reflected wrench.
    pub force: f64,
}

/// Factors on the gains in one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Factors {
    /// Factor on K_V and K_P, per axis.
    pub command: [f64; 6],
    /// Factor on K_T.
    pub force: f64,
}

/// Scale and locks, with the ramp of the factors to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaling {
    scale: Scale,
    locked: [bool; 6],
    factors: Factors,
    /// Factor on K_T in the last cycle.
    force_before: f64,
    /// Duration of a ramp, in cycles.
    ramp: u32,
    /// Remaining cycles of the ramp.
    left: u32,
}

impl Scale {
    /// Scales of 1.
    pub const ONE: Self = Self { motion: 1.0, rotation: 1.0, force: 1.0 };

    /// Returns the factor on a quantity, dimensionless.
    pub const fn factor(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Motion => self.motion,
            Quantity::Rotation => self.rotation,
            Quantity::Force => self.force,
        }
    }
}

impl Factors {
    /// Factors that change no gain.
    pub const ONE: Self = Self { command: [1.0; 6], force: 1.0 };
}

impl Scaling {
    /// Creates a scaling with factors of 1 and no locks.
    pub fn new(period: Period) -> Self {
        let ramp = period.cycles(RAMP_S).max(1);
        let (scale, factors) = (Scale::ONE, Factors::ONE);
        Self { scale, locked: [false; 6], factors, force_before: 1.0, ramp, left: 0 }
    }

    /// Returns the scale last set.
    pub const fn scale(&self) -> &Scale {
        &self.scale
    }

    /// Returns the lock of each axis.
    pub const fn locked(&self) -> &[bool; 6] {
        &self.locked
    }

    /// Returns the factors of this cycle.
    pub const fn factors(&self) -> &Factors {
        &self.factors
    }

    /// Returns the rise of the force factor in this cycle, relative to the factor, 0 to 1.
    pub fn force_rise(&self) -> f64 {
        let now = self.factors.force;
        if now > self.force_before { (now - self.force_before) / now } else { 0.0 }
    }

    /// Sets the scale of a quantity, clamped to 0 and [`MAX_GAIN`], and starts a ramp.
    pub const fn set(&mut self, quantity: Quantity, factor: f64) {
        let scale = match quantity {
            Quantity::Motion => &mut self.scale.motion,
            Quantity::Rotation => &mut self.scale.rotation,
            Quantity::Force => &mut self.scale.force,
        };
        *scale = factor.clamp(0.0, MAX_GAIN);
        self.left = self.ramp;
    }

    /// Locks or releases an axis, and starts a ramp.
    pub const fn lock(&mut self, axis: LockAxis, is_locked: bool) {
        let [x, y, z, rx, ry, rz] = &mut self.locked;
        *match axis {
            LockAxis::X => x,
            LockAxis::Y => y,
            LockAxis::Z => z,
            LockAxis::Rx => rx,
            LockAxis::Ry => ry,
            LockAxis::Rz => rz,
        } = is_locked;
        self.left = self.ramp;
    }

    /// Advances the ramp by one cycle. Returns whether the factors changed.
    pub fn advance(&mut self) -> bool {
        self.force_before = self.factors.force;
        if self.left == 0 {
            return false;
        }
        let goal = self.goal();
        let share = f64::from(self.left).recip();
        let next =
            |from: f64, to: f64| if self.left == 1 { to } else { from + (to - from) * share };
        let Factors { command, force } = &mut self.factors;
        command.iter_mut().zip(goal.command).for_each(|(factor, to)| *factor = next(*factor, to));
        *force = next(*force, goal.force);
        self.left -= 1;
        true
    }

    /// Returns the factors at the end of the ramp.
    fn goal(&self) -> Factors {
        let Scale { motion, rotation, force } = self.scale;
        let command = LockAxis::ALL.map(|axis| {
            let scale = if axis.is_rotation() { rotation } else { motion };
            if axis.entry(&self.locked) { 0.0 } else { scale }
        });
        Factors { command, force }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn scaling() -> Scaling {
        Scaling::new(Period::new(1e-3).unwrap())
    }

    #[test]
    fn factors_reach_scale_and_locks_in_half_a_second() {
        let mut scaling = scaling();
        scaling.set(Quantity::Motion, 0.5);
        scaling.set(Quantity::Force, 0.2);
        scaling.lock(LockAxis::Rz, true);
        let cycles = (0..).take_while(|_| scaling.advance()).count();
        assert_eq!(cycles, 500);
        let expected = Factors { command: [0.5, 0.5, 0.5, 1.0, 1.0, 0.0], force: 0.2 };
        assert_eq!(*scaling.factors(), expected);
        assert_eq!((scaling.scale().motion, scaling.locked()[5]), (0.5, true));
    }

    #[test]
    fn untouched_scaling_changes_no_gain() {
        let mut scaling = scaling();
        assert!(!scaling.advance());
        assert_eq!(*scaling.factors(), Factors::ONE);
    }

    #[test]
    fn rise_of_the_force_is_a_share_of_it() {
        let mut scaling = scaling();
        scaling.set(Quantity::Force, 0.0);
        while scaling.advance() {
            assert_eq!(scaling.force_rise().to_bits(), 0.0_f64.to_bits());
        }
        scaling.set(Quantity::Force, 1.0);
        scaling.advance();
        assert!((scaling.force_rise() - 1.0).abs() < 1e-12, "from nothing");
        scaling.advance();
        assert!((scaling.force_rise() - 0.5).abs() < 1e-12, "doubled");
    }

    #[test]
    fn released_axis_has_the_present_scale() {
        let mut scaling = scaling();
        scaling.lock(LockAxis::X, true);
        while scaling.advance() {}
        scaling.set(Quantity::Motion, 0.25);
        scaling.lock(LockAxis::X, false);
        while scaling.advance() {}
        assert_eq!(scaling.factors().command[0].to_bits(), 0.25_f64.to_bits());
    }

    proptest! {
        #[test]
        fn no_factor_moves_faster_than_its_ramp(
            changes in prop::collection::vec((0..3_usize, 0.0..2.0_f64, 0..6_usize, any::<bool>(), 0..700_u32), 1..8)
        ) {
            let mut scaling = scaling();
            for (quantity, factor, axis, is_locked, cycles) in changes {
                scaling.set([Quantity::Motion, Quantity::Rotation, Quantity::Force][quantity], factor);
                scaling.lock(LockAxis::ALL[axis], is_locked);
                for _ in 0..cycles {
                    let before = *scaling.factors();
                    scaling.advance();
                    let after = scaling.factors();
                    // A factor changes by at most 2 in 0.5 s.
                    let steps = before.command.iter().zip(after.command).map(|(a, b)| (a - b).abs());
                    prop_assert!(steps.chain([(before.force - after.force).abs()]).all(|step| step <= 2.0 / 500.0 + 1e-12));
                }
            }
        }
    }
}
