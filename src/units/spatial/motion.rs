//! Commands to the commanded object.

use nalgebra::Isometry3;

use crate::spatial::Twist;

/// A command to the object under control at {MRF}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Hold: a rate of zero, and no pose.
    Hold,
    /// Twist of {MRF}, written in {MRF} (Eq. 5).
    Rate(Twist),
    /// Pose `x_b_d` (3.5).
    Pose(Isometry3<f64>),
}
