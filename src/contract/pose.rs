//! Pose in the layout of ROS (`geometry_msgs/Pose`): position, then orientation as x, y, z, w.

use crate::codec::are_within;

/// Maximum distance along any axis, in m.
pub const MAX_DISTANCE: f64 = 1e3;

/// Tolerance of a quaternion's norm.
pub const NORM_TOLERANCE: f64 = 1e-6;

/// Pose of {MRF} in {b}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position, in m.
    pub position: [f64; 3],
    /// Orientation: unit quaternion x, y, z, w.
    pub orientation: [f64; 4],
}

impl Default for Pose {
    fn default() -> Self {
        Self { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] }
    }
}

impl Pose {
    /// Returns position and orientation in the order of the wire.
    pub(crate) const fn numbers(&self) -> [f64; 7] {
        let ([x, y, z], [i, j, k, w]) = (self.position, self.orientation);
        [x, y, z, i, j, k, w]
    }

    /// Creates a pose from the wire; `None` for a distance out of range, or a quaternion that is not a unit.
    pub(crate) fn from_numbers([x, y, z, i, j, k, w]: [f64; 7]) -> Option<Self> {
        let (position, orientation) = ([x, y, z], [i, j, k, w]);
        let norm = orientation.iter().map(|part| part * part).sum::<f64>().sqrt();
        let is_valid = are_within(&position, MAX_DISTANCE) && (norm - 1.0).abs() <= NORM_TOLERANCE;
        is_valid.then_some(Self { position, orientation })
    }
}
