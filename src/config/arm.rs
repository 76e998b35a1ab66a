//! `[arm]` and `[coupling]`: what belongs to no single joint.

use nalgebra::Isometry3;
use nalgebra::Translation3;
use nalgebra::UnitQuaternion;

use crate::bodies;
use crate::joints::JointParameters;
use crate::problem::Problems;
use crate::raw;
use controller::calibration::Calibration;
use controller::coupling::Coupling;

/// Pose of the grip in link 6, and gravity in {0}.
pub(super) fn grip_and_gravity(
    arm: &raw::Arm,
    problems: &mut Problems<'_>,
) -> (Isometry3<f64>, [f64; 3]) {
    let [x, y, z] = problems.all_finite("arm.grip_m", arm.grip_m.0);
    let [about_x, about_y, about_z] = problems.all_finite("arm.grip_rad", arm.grip_rad.0);
    let gravity = bodies::gravity(arm, problems);
    let x_6_g = Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(about_x, about_y, about_z),
    );
    (x_6_g, gravity)
}

/// Encoders and torque curves of all joints, and what couples them.
pub(super) fn calibration(
    joints: &[JointParameters; 6],
    coupling: Option<Coupling<6>>,
) -> Calibration<6> {
    let calibration = Calibration::new(joints.each_ref().map(|joint| joint.calibration));
    coupling.map_or(calibration, |coupling| calibration.coupled(coupling))
}

/// What couples joints and actuators; `None` where nothing does, or a problem has been noted.
pub(super) fn coupling(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Coupling<6>> {
    let given = raw.coupling.as_ref()?;
    problems.take(
        "coupling.matrix",
        Coupling::new(given.matrix.0.map(|row| row.0), given.offset_rad_or_m.0),
    )
}
