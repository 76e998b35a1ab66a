//! A joint of a robot file as the simulation describes it.

use nalgebra::Matrix3;

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
            inertia: tensor(joint.inertia),
            rotor_inertia,
        },
        start,
        coulomb: joint.coulomb,
        viscous: joint.viscous,
        max_torque: joint.max_torque,
    }
}

fn tensor([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}
