//! `[arm]` and `[coupling]`: what belongs to no single joint.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use crate::joints::JointParameters;
use crate::problem::Problems;
use crate::raw;
use controller::calibration::Calibration;
use controller::coupling::Coupling;
use toml_input::List;

/// Pose of the grip in link 6.
pub(super) fn grip(arm: &raw::Arm, problems: &mut Problems<'_>) -> Option<Isometry3<f64>> {
    let position = problems.all_finite(&arm.grip_m);
    let angles = problems.all_finite(&arm.grip_rad.or(List::default()));
    let [about_x, about_y, about_z] = angles?;
    Some(Isometry3::from_parts(
        Translation3::from(position?),
        UnitQuaternion::from_euler_angles(about_x, about_y, about_z),
    ))
}

/// Encoders and torque curves of all joints, and what couples them.
pub(super) fn calibration(
    joints: &[JointParameters; 6],
    coupling: Option<Coupling<6>>,
) -> Calibration<6> {
    let calibration = Calibration::new(joints.each_ref().map(|joint| joint.calibration));
    coupling.map_or(calibration, |coupling| calibration.coupled(coupling))
}

/// Coupling of joints and actuators; `None` where nothing does, or a problem has been noted.
pub(super) fn coupling(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Coupling<6>> {
    let given = raw.coupling.as_ref()?;
    let List(rows) = given.matrix.get()?;
    let List(offset) = given.offset_rad_or_m.or(List::default()).get()?;
    problems.take(&given.matrix, Coupling::new(rows.map(|List(row)| row), offset))
}
