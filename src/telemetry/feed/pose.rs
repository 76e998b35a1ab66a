//! A pose in JSON.

use nalgebra::Isometry3;
use serde::Serialize;

/// Position in m, and a unit quaternion: w, x, y, z.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Pose {
    position: [f64; 3],
    quaternion: [f64; 4],
}

impl Pose {
    pub(super) fn from_isometry(pose: &Isometry3<f64>) -> Self {
        let q = pose.rotation.quaternion();
        Self { position: pose.translation.vector.into(), quaternion: [q.w, q.i, q.j, q.k] }
    }
}
