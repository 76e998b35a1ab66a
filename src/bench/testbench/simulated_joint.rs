//! Conversion of a joint of a robot file to the settings of the simulation.

use crate::world;
use config::robots::RobotJoint;
use sim::arm::LinkSettings;
use sim::manipulator::JointSettings;

/// Returns the joint with its link.
pub(crate) fn settings(joint: &RobotJoint) -> JointSettings {
    let RobotJoint { link, start, mass, centre_of_mass, rotor_inertia, .. } = *joint;
    JointSettings {
        link: LinkSettings {
            is_prismatic: false,
            alpha: link.alpha,
            a: link.a,
            d: link.d,
            theta: link.theta,
            mass,
            centre_of_mass: centre_of_mass.into(),
            inertia: world::inertia(joint.inertia),
            rotor_inertia,
        },
        start,
        coulomb: joint.coulomb,
        viscous: joint.viscous,
        max_torque: joint.max_torque,
    }
}
