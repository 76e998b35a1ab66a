//! Posture of the arm at contact with the wall in pose mode, which bounds how well contact is rendered.
//!
//! The object moves from its start against the wall, by K_P times the grip's displacement along the axes of {G0}.

use std::ops::RangeInclusive;

use nalgebra::Vector3;

use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use controller::JointVector;
use controller::contact_posture::{ContactPosture, OutOfReach, PostureBounds};
use remote::scene::HALF_CUBE;

/// Maximum penetration at the start that counts as touching the wall, in m.
const CONTACT_AT_START: f64 = 1e-6;

/// Range of the smallest singular value of the Jacobian, in m and rad; it ends at the length of the longest links.
const MIN_SIGMA: RangeInclusive<f64> = 1e-6..=10.0;

/// Range of the largest friction at the grip, in N.
const MAX_FRICTION_N: RangeInclusive<f64> = 1e-6..=1e4;

/// Component of a direction, relative to its length, below which it is zero.
const ROUNDING: f64 = 1e-9;

/// Reads the bounds of `[arm]`, with defaults for absent keys that every posture satisfies.
pub(super) fn bounds(arm: &raw::Arm, problems: &mut Problems<'_>) -> PostureBounds {
    let PostureBounds { min_sigma, max_friction_n } = PostureBounds::default();
    let min_sigma = if arm.min_singular_value.as_ref().is_some() {
        problems.within(&arm.min_singular_value, MIN_SIGMA).unwrap_or(min_sigma)
    } else {
        min_sigma
    };
    let max_friction_n = if arm.max_grip_friction_n.as_ref().is_some() {
        problems.within(&arm.max_grip_friction_n, MAX_FRICTION_N).unwrap_or(max_friction_n)
    } else {
        max_friction_n
    };
    PostureBounds { min_sigma, max_friction_n }
}

/// First contact with the wall in pose mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallContact {
    /// Displacement of the grip from the start, in {0}, in m; infinite with a gain of zero.
    pub displacement: Vector3<f64>,
    /// Posture of the arm at the contact, or an error if it cannot be reached.
    pub posture: Result<ContactPosture, OutOfReach>,
}

impl Parameters {
    /// Returns the configured Coulomb friction of the joints, in N·m or N.
    pub fn dry_friction(&self) -> JointVector {
        JointVector::from(self.joints.each_ref().map(|joint| joint.plant.friction.coulomb))
    }

    /// Returns the penetration of the wall at the start, in m; `None` if the object starts outside or touches it.
    pub fn wall_depth_at_start(&self) -> Option<f64> {
        let depth = -self.distance_to_wall()?;
        (depth > CONTACT_AT_START).then_some(depth)
    }

    /// Returns the first contact with the wall in pose mode; `None` without a wall, or if the start touches it.
    pub fn wall_contact(&self) -> Option<WallContact> {
        let away = self.distance_to_wall().filter(|away| *away > 0.0)?;
        let (_, normal, _) = self.remote.wall?;
        let into = -normal.into_inner();
        let arm = &self.controller.arm;
        let start = JointVector::from(self.joints.each_ref().map(|joint| joint.plant.start));
        let [k_x, k_y, k_z, ..] = *self.controller.command.pose_gain.values();
        let object = self.remote.x_b_m.rotation.inverse() * into * away;
        let in_g0 = displacement(&object, &Vector3::new(k_x, k_y, k_z));
        let displacement = in_g0.map(|in_g0| arm.forward(&start).rotation * in_g0);
        let posture = displacement.and_then(|displacement| {
            ContactPosture::after(arm, &start, &displacement, &self.dry_friction())
        });
        let displacement = displacement.unwrap_or(Vector3::repeat(f64::INFINITY));
        Some(WallContact { displacement, posture })
    }

    /// Returns the distance of the object from the wall at the start, in m; negative inside the wall.
    fn distance_to_wall(&self) -> Option<f64> {
        let (point, normal, _) = self.remote.wall?;
        let to_point = point - self.remote.x_b_m.translation.vector;
        Some(to_point.dot(&-normal.into_inner()) - HALF_CUBE)
    }
}

/// Returns the displacement of the grip, along the axes of {G0}, that commands this one of the object.
///
/// # Errors
/// Returns the axis whose gain is too small.
fn displacement(object: &Vector3<f64>, gain: &Vector3<f64>) -> Result<Vector3<f64>, OutOfReach> {
    let needed = object.zip_map(gain, |part, gain| {
        let is_rounding = part.abs() < ROUNDING * object.norm();
        if is_rounding { 0.0 } else { part / gain }
    });
    let axis = needed.iamax();
    match needed.norm().is_finite() {
        true => Ok(needed),
        false => Err(OutOfReach::NoGain {
            axis: ['x', 'y', 'z'].get(axis).copied().unwrap_or('z'),
            gain: gain.iter().nth(axis).copied().unwrap_or_default(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_of_zero_towards_the_wall_is_named_by_its_axis() {
        let object = Vector3::new(1e-18, -0.05, 0.0);
        let grip = |gain: [f64; 3]| displacement(&object, &Vector3::from(gain));
        assert_eq!(grip([0.0, 0.5, 0.0]), Ok(Vector3::new(0.0, -0.1, 0.0)));
        assert_eq!(grip([1.0, 0.0, 1.0]), Err(OutOfReach::NoGain { axis: 'y', gain: 0.0 }));
        assert!(matches!(grip([1.0, 1e-300, 1.0]), Err(OutOfReach::NoGain { axis: 'y', .. })));
    }
}
