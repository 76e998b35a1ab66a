//! Postures in which the hand meets the surfaces in pose mode: how well the arm renders contact there.
//!
//! The object moves from its start against the wall, by K_P times the hand's displacement along the axes of {G0}.

use nalgebra::Vector3;

use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use controller::JointVector;
use controller::contact_posture::{ContactPosture, OutOfReach, PostureBounds};
use remote::scene::HALF_CUBE;

/// Depth in m up to which the object only touches the wall at its start.
const CONTACT_AT_START: f64 = 1e-6;

/// Reads the bounds of `[arm]`; without their keys every posture is within them.
pub(super) fn bounds(arm: &raw::Arm, problems: &mut Problems<'_>) -> PostureBounds {
    let PostureBounds { min_sigma, max_friction_n } = PostureBounds::default();
    let min_sigma = if arm.min_singular_value.as_ref().is_some() {
        problems.positive(&arm.min_singular_value).unwrap_or(min_sigma)
    } else {
        min_sigma
    };
    let max_friction_n = if arm.max_grip_friction_n.as_ref().is_some() {
        problems.positive(&arm.max_grip_friction_n).unwrap_or(max_friction_n)
    } else {
        max_friction_n
    };
    PostureBounds { min_sigma, max_friction_n }
}

/// Contact with the wall in pose mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallContact {
    /// Way of the grip from the start, in {0} in m.
    pub way: Vector3<f64>,
    /// Posture there.
    pub posture: Result<ContactPosture, OutOfReach>,
}

impl Parameters {
    /// Returns the joints' configured dry friction, in N·m or N.
    pub fn dry_friction(&self) -> JointVector {
        JointVector::from(self.joints.each_ref().map(|joint| joint.plant.friction.coulomb))
    }

    /// Returns the depth in m by which the object starts in the wall; `None` where it does not.
    pub fn wall_depth_at_start(&self) -> Option<f64> {
        let depth = -self.way_to_wall()?;
        (depth > CONTACT_AT_START).then_some(depth)
    }

    /// Returns how the hand meets the wall in pose mode; `None` without a wall, or where the start touches it.
    pub fn wall_contact(&self) -> Option<WallContact> {
        let away = self.way_to_wall().filter(|away| *away > 0.0)?;
        let (_, normal, _) = self.remote.wall?;
        let into = -normal.into_inner();
        let arm = &self.controller.arm;
        let start = JointVector::from(self.joints.each_ref().map(|joint| joint.plant.start));
        let [k_x, k_y, k_z, ..] = *self.controller.command.pose_gain.values();
        let in_g0 = (self.remote.x_b_m.rotation.inverse() * into * away)
            .component_div(&Vector3::new(k_x, k_y, k_z));
        let way = arm.forward(&start).rotation * in_g0;
        let posture = ContactPosture::after(arm, &start, &way, &self.dry_friction());
        Some(WallContact { way, posture })
    }

    /// Returns the way of the object from its start to the wall, in m; negative where it starts in the wall.
    fn way_to_wall(&self) -> Option<f64> {
        let (point, normal, _) = self.remote.wall?;
        let way = point - self.remote.x_b_m.translation.vector;
        Some(way.dot(&-normal.into_inner()) - HALF_CUBE)
    }
}
