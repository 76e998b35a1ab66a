//! Test motor: a rotor with friction and a constant load, behind a current loop.

use crate::motion::Feedback;
use crate::motion::shaft::Actual;
use crate::motion::units::wrapped;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rotor {
    /// Inertia, in ‰ per increment/s².
    pub(super) inertia: f64,
    /// Coulomb friction, in ‰.
    pub(super) coulomb: f64,
    /// Constant load torque, in ‰.
    pub(super) load: f64,
    /// Unwrapped position, in increments.
    pub(super) position: f64,
    /// Position of an index pulse, in increments.
    pub(super) index: f64,
    /// Velocity, in increments/s.
    pub(super) velocity: f64,
    /// Motor torque, in ‰.
    pub(super) torque: f64,
}

impl Default for Rotor {
    fn default() -> Self {
        Self {
            inertia: 2.5e-5,
            coulomb: 0.0,
            load: 0.0,
            position: 0.0,
            index: 0.0,
            velocity: 0.0,
            torque: 0.0,
        }
    }
}

/// Integration steps per servo period.
const STEPS: u32 = 100;
/// Time constant of the current loop, in s.
const LAG: f64 = 0.2e-3;
/// Velocity at which Coulomb friction saturates, in increments/s.
const FRICTION_VELOCITY: f64 = 50.0;

impl Rotor {
    /// Applies a torque demand, in ‰, for `dt` s.
    pub(super) fn step(&mut self, dt: f64, demand: f64) {
        let step = dt / f64::from(STEPS);
        for _ in 0..STEPS {
            self.torque += (demand - self.torque) * step / LAG;
            let friction = self.coulomb * (self.velocity / FRICTION_VELOCITY).tanh();
            self.velocity += (self.torque - self.load - friction) / self.inertia * step;
            self.position += self.velocity * step;
        }
    }

    pub(super) const fn actual(&self) -> Actual {
        Actual {
            position: self.position.round(),
            index: self.index,
            velocity: self.velocity,
            per_mille: self.torque,
        }
    }

    pub(super) fn feedback(&self) -> Feedback {
        let Actual { position, index, velocity, per_mille } = self.actual();
        Feedback { position: wrapped(position), index, velocity, per_mille }
    }
}
