//! Checks that gravity, centres of mass and inertias of `[arm]` and `[[joint]]` are physically possible.

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, Vector3};

use crate::problem::Problems;
use crate::raw;
use crate::value::{HasPlace, Value};
use toml_input::List;

/// Range of gravity on a planet or moon, in m/s². It excludes 9810, which is in mm/s².
const GRAVITY: RangeInclusive<f64> = 1.0..=20.0;

/// Maximum distance of a centre of mass from its link's frame, in m. The length of a link does not bound it, because
/// counterweights lie behind their joint.
const MAX_DISTANCE: f64 = 2.0;

/// Range of the inertia or mass of a rotor, seen behind its gear, in kg·m² or kg.
pub(super) const ROTOR: RangeInclusive<f64> = 1e-6..=1e4;

/// Range of viscous friction, in N·m·s/rad or N·s/m.
pub(super) const VISCOUS: RangeInclusive<f64> = 0.0..=1e4;

/// Relative excess of the largest principal moment over the sum of the others that rounding in the file may cause.
const ROUNDING: f64 = 1e-2;

/// Reads gravity in {0}, in m/s², in any direction; zero for an arm balanced by springs or counterweights.
pub(super) fn gravity(arm: &raw::Arm, problems: &mut Problems<'_>) -> Option<[f64; 3]> {
    let gravity = problems.all_finite(&arm.gravity_m_per_s2)?;
    if arm.gravity_balanced.or(false).get()? {
        return Some([0.0; 3]);
    }
    let strength = Vector3::from(gravity).norm();
    if strength.is_finite() && !GRAVITY.contains(&strength) {
        let (least, most) = (GRAVITY.start(), GRAVITY.end());
        let reason = format!(
            "must be {least} to {most} m/s² long, got {strength:.1}; an arm that springs carry says \
             {} = true",
            arm.gravity_balanced.place().name()
        );
        problems.add(&arm.gravity_m_per_s2, reason);
    }
    Some(gravity)
}

/// Reads a centre of mass in its link's frame, in m.
pub(super) fn centre_of_mass(
    value: &Value<List<f64, 3>>,
    problems: &mut Problems<'_>,
) -> Option<[f64; 3]> {
    let centre = problems.all_finite(value)?;
    let distance = Vector3::from(centre).norm();
    if distance.is_finite() && distance > MAX_DISTANCE {
        let reason =
            format!("must be within {MAX_DISTANCE} m of the link's frame, got {distance:.1} m");
        problems.add(value, reason);
    }
    Some(centre)
}

/// Reads an inertia about the centre of mass as xx, yy, zz, xy, xz, yz, in kg·m²; all zero for a point mass.
pub(super) fn inertia(
    value: &Value<List<f64, 6>>,
    problems: &mut Problems<'_>,
) -> Option<[f64; 6]> {
    let inertia = problems.all_finite(value)?;
    let is_point = inertia.iter().all(|part| part.abs() <= 0.0);
    if is_point || !inertia.iter().all(|part| part.is_finite()) {
        return Some(inertia);
    }
    let [xx, yy, zz, xy, xz, yz] = inertia;
    let matrix = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let mut principal = matrix.symmetric_eigenvalues();
    principal.as_mut_slice().sort_by(f64::total_cmp);
    let (least, middle, most) = (principal.x, principal.y, principal.z);
    if least <= 0.0 {
        let reason = format!(
            "must be positive about every axis, got a principal moment of {least:.3e} kg·m²"
        );
        problems.add(value, reason);
    } else if most > (least + middle) * (1.0 + ROUNDING) {
        let reason = format!(
            "must be that of a body: no principal moment above the sum of the others, got {most:.3e} kg·m² \
             beside {middle:.3e} and {least:.3e}"
        );
        problems.add(value, reason);
    }
    Some(inertia)
}
