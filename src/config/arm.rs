//! `[arm]` and `[coupling]`: grip pose, calibration and coupling of the arm as a unit.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use crate::joints::JointParameters;
use crate::problem::Problems;
use crate::raw;
use controller::calibration::Calibration;
use controller::coupling::Coupling;
use toml_input::List;

/// Reads the pose of {G} in link 6: `grip_m` in m, `grip_rad` about x, y, z in rad.
pub(super) fn grip(arm: &raw::Arm, problems: &mut Problems<'_>) -> Option<Isometry3<f64>> {
    let position = problems.all_finite(&arm.grip_m);
    let angles = problems.all_finite(&arm.grip_rad.or(List::default()));
    let [about_x, about_y, about_z] = angles?;
    Some(Isometry3::from_parts(
        Translation3::from(position?),
        UnitQuaternion::from_euler_angles(about_x, about_y, about_z),
    ))
}

/// Combines the calibrations of all joints with their coupling, if any.
pub(super) fn calibration(
    joints: &[JointParameters; 6],
    coupling: Option<Coupling<6>>,
) -> Calibration<6> {
    let calibration = Calibration::new(joints.each_ref().map(|joint| joint.calibration));
    coupling.map_or(calibration, |coupling| calibration.coupled(coupling))
}

/// Reads the coupling of joints and actuators. Returns `None` without the section, or after a problem.
pub(super) fn coupling(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Coupling<6>> {
    let given = raw.coupling.as_ref()?;
    let List(rows) = given.matrix.get()?;
    let List(offset) = given.offset_rad_or_m.or(List::default()).get()?;
    problems.take(&given.matrix, Coupling::new(rows.map(|List(row)| row), offset))
}
