//! Motion command to the object.

use nalgebra::Isometry3;

use crate::spatial::Twist;

/// Commanded motion of the object under control at {MRF}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Rate of zero, without a commanded pose.
    Hold,
    /// Twist of {MRF}, written in {MRF} (Eq. 5).
    Rate(Twist),
    /// Pose `x_b_d` (3.5).
    Pose(Isometry3<f64>),
}

/// Quantity that the hand's displacement commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CommandMode {
    /// Displacement commands velocity (Fig. 3).
    #[default]
    Rate,
    /// Displacement commands displacement (3.5).
    Pose,
}
