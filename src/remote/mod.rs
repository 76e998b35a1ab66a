//! Where commands go and wrenches come from: an object in this process, a robot over a network, a
//! force/torque sensor. One exchange a cycle, which never waits.

use nalgebra::Isometry3;

use crate::spatial::Motion;
use crate::spatial::Wrench;
use crate::time::Instant;

/// The commanded side.
pub trait Remote {
    /// Hands over this cycle's command and takes the newest sample. Never waits: what has not come
    /// in is simply older.
    fn exchange(&mut self, now: Instant, command: &Motion) -> Sensed;
}

/// What is felt and seen on the commanded side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensed {
    /// When it was sampled.
    pub at: Instant,
    /// The wrench of the environment *on* the object, at the sensor {S}, payload removed.
    pub f_s: Wrench,
    /// The pose of the frame under control in its base.
    pub x_b_m: Isometry3<f64>,
}
