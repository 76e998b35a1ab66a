//! Where commands go and wrenches come from: an object in this process, a robot over a network, a
//! force/torque sensor. One exchange a cycle, which never waits.
//!
//! ```
//! use remote::{Remote, Sensed};
//! use units::spatial::{Motion, Wrench};
//! use units::time::Instant;
//!
//! /// A robot that feels nothing.
//! struct Deaf;
//!
//! impl Remote for Deaf {
//!     fn exchange(&mut self, now: Instant, _: &Motion) -> Option<Sensed> {
//!         Some(Sensed { at: now, f_s: Wrench::ZERO, x_b_m: nalgebra::Isometry3::identity() })
//!     }
//! }
//! assert!(Deaf.exchange(Instant::ZERO, &Motion::Hold).unwrap().is_possible());
//! ```
#![forbid(unsafe_code)]

pub mod scene;
pub mod site;

use nalgebra::Isometry3;

use units::spatial::Motion;
use units::spatial::Wrench;
use units::time::Instant;

/// No sensor reads more, in N or N·m.
const LARGEST_READING: f64 = 1e5;

/// No object is farther from its base along any axis, in m.
const FARTHEST: f64 = 1e3;

/// A quaternion's length may be off by so much for its rotation to be one.
const UNEVEN: f64 = 1e-6;

/// The commanded side.
pub trait Remote {
    /// Hands over this cycle's command and takes the newest sample, `None` while there has been none.
    /// Never waits: what has not come in is simply older.
    fn exchange(&mut self, now: Instant, command: &Motion) -> Option<Sensed>;
}

/// What is felt and seen on the commanded side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensed {
    /// When it was sampled, not when it came: on the clock of whoever takes it, and rather too early
    /// than too late.
    pub at: Instant,
    /// The wrench of the environment *on* the object, at the sensor {S}, payload removed.
    pub f_s: Wrench,
    /// The pose of the frame under control in its base.
    pub x_b_m: Isometry3<f64>,
}

impl Sensed {
    /// Whether there can be such a wrench and such a pose at all; not whether they are plausible.
    pub fn is_possible(&self) -> bool {
        let is_wrench = self.f_s.components().iter().all(|part| part.abs() <= LARGEST_READING);
        let place = &self.x_b_m.translation.vector;
        let is_place = place.iter().all(|part| part.abs() <= FARTHEST);
        let is_rotation = (self.x_b_m.rotation.norm() - 1.0).abs() <= UNEVEN;
        is_wrench && is_place && is_rotation
    }
}
