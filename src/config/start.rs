//! Check of the start position: every motor must be able to hold the weight of the arm there.

use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use controller::JointVector;
use controller::arm::JointKind;

/// Checks that holding the weight at the start position stays within each actuator's maximum torque.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let controller = &config.controller;
    let q = JointVector::from(config.joints.each_ref().map(|joint| joint.plant.start));
    let tau = controller.arm.gravity(&controller.arm.posture(&q));
    let needed = controller.calibration.coupling().at_actuators(&tau);
    for ((joint, needed), raw) in config.joints.iter().zip(needed.iter()).zip(raw.joint.all()) {
        let (needed, max) = (needed.abs(), joint.plant.actuator.max_torque);
        // NaN is refused.
        if needed > max || needed.is_nan() {
            let (given, unit) = match joint.plant.link.kind {
                JointKind::Revolute => (&raw.max_torque_nm, "N·m"),
                JointKind::Prismatic => (&raw.max_force_n, "N"),
            };
            let reason = format!(
                "must hold the arm at its start: {needed:.2} {unit} are needed, got {max} {unit}; choose \
                 another start or motor"
            );
            problems.add(given, reason);
        }
    }
}
