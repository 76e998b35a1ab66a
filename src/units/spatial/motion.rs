//! What a commanded object is asked to do.

use nalgebra::Isometry3;

use crate::spatial::Twist;

/// A command to the object under control at {MRF}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Stay where you are: a rate of zero, and no pose.
    Hold,
    /// Move with this twist of {MRF}, written in {MRF} (Eq. 5).
    Rate(Twist),
    /// Be at this pose `x_b_d` (3.5).
    Pose(Isometry3<f64>),
}
