//! `[arm]` and `[[joint]]`: the arm, its encoders, its torque curves.

use std::path::Path;

use nalgebra::Isometry3;
use nalgebra::Translation3;
use nalgebra::UnitQuaternion;

use crate::canopen::NodeId;
use crate::canopen::eds::Eds;
use crate::canopen::frame::Channel;
use crate::canopen::plan::Identity;
use crate::config::lookup;
use crate::config::problem::Problems;
use crate::config::raw;
use crate::controller::arm::JointKind;
use crate::controller::arm::Link;
use crate::controller::calibration::Calibration;
use crate::controller::calibration::JointCalibration;
use crate::controller::calibration::TorqueCurve;

/// One joint: where it is on the network, how it moves, what moves it.
#[derive(Clone, Debug)]
pub struct Joint {
    /// What people call it.
    pub name: String,
    /// Its drive's bus.
    pub channel: Channel,
    /// Its drive's node-id.
    pub node: NodeId,
    /// What its drive must be.
    pub identity: Identity,
    /// What its drive's maker says of it.
    pub eds: Eds,
    /// Kinematics, mass and range.
    pub link: Link,
    /// Inertia about the centre of mass, in kg·m²: xx, yy, zz, xy, xz, yz.
    pub inertia: [f64; 6],
    /// Inertia of the rotor, seen at the joint, in kg·m².
    pub rotor_inertia: f64,
    /// Dry friction at the joint, in N·m.
    pub coulomb_friction: f64,
    /// Viscous friction at the joint, in N·m·s/rad.
    pub viscous_friction: f64,
    /// Encoder counts per revolution of the motor.
    pub counts_per_rev: u32,
    /// Motor revolutions per joint revolution; negative where they turn against each other.
    pub gear_ratio: f64,
    /// Counts at joint position zero.
    pub zero_counts: i32,
    /// The motor's rated torque, in N·m.
    pub rated_torque: f64,
    /// The most the joint is asked for, in N·m.
    pub max_torque: f64,
    /// c1, c3, c5 of the torque curve.
    pub torque_curve: [f64; 3],
    /// Encoder and torque curve, as the controller uses them.
    pub calibration: JointCalibration,
}

/// All six joints; `None` where a problem has been noted.
pub(super) fn joints(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<[Joint; 6]> {
    let mut joints = Vec::new();
    for (place, joint) in raw.joint.iter().enumerate() {
        joints.push(read(file, raw, place, joint, problems));
    }
    let joints: Vec<Joint> = joints.into_iter().collect::<Option<_>>()?;
    let found = joints.len();
    let all = joints.try_into().ok();
    if all.is_none() {
        problems.add("joint", format_args!("{found} joints; a hand controller has 6"));
    }
    all
}

fn read(
    file: &Path,
    raw: &raw::File,
    place: usize,
    joint: &raw::Joint,
    problems: &mut Problems<'_>,
) -> Option<Joint> {
    let key = |name: &str| format!("joint[{place}].{name}");
    let channel = lookup::channel(&key("bus"), raw, &joint.bus, problems);
    let node = lookup::node_id(&key("node_id"), joint.node_id, problems);
    let eds = lookup::eds(&key("eds"), file, &joint.eds, problems);
    let identity =
        Identity { vendor: joint.vendor_id, product: joint.product_code, revision: joint.revision };
    let [low, high] = problems.all_finite(&key("limit_deg"), joint.limit_deg);
    if low >= high {
        problems.add(&key("limit_deg"), format_args!("from {low} to {high} is no range"));
    }
    let link = Link {
        kind: JointKind::Revolute,
        alpha: problems.finite(&key("alpha_deg"), joint.alpha_deg).to_radians(),
        a: problems.within(&key("a_m"), joint.a_m, -10.0..=10.0),
        d: problems.within(&key("d_m"), joint.d_m, -10.0..=10.0),
        theta: problems.finite(&key("theta_deg"), joint.theta_deg).to_radians(),
        mass: problems.within(&key("mass_kg"), joint.mass_kg, 0.0..=1_000.0),
        centre_of_mass: problems.all_finite(&key("centre_of_mass_m"), joint.centre_of_mass_m),
        range: [low.to_radians(), high.to_radians()],
    };
    let before = problems.count();
    let max_torque = problems.positive(&key("max_torque_nm"), joint.max_torque_nm);
    let curve = TorqueCurve::new(joint.torque_curve, max_torque);
    let curve = problems.take_unless_noted(before, &key("torque_curve"), curve);
    let calibration = curve.and_then(|curve| {
        let counts = joint.encoder_counts_per_rev;
        let made = JointCalibration::new(counts, joint.gear_ratio, joint.zero_counts, curve);
        problems.take(&key("gear_ratio"), made)
    });
    let inertia = problems.all_finite(&key("inertia_kg_m2"), joint.inertia_kg_m2);
    let rotor_inertia = problems.positive(&key("rotor_inertia_kg_m2"), joint.rotor_inertia_kg_m2);
    let coulomb_friction =
        problems.not_negative(&key("coulomb_friction_nm"), joint.coulomb_friction_nm);
    let viscous_friction = problems
        .not_negative(&key("viscous_friction_nms_per_rad"), joint.viscous_friction_nms_per_rad);
    let rated_torque = problems.within(&key("rated_torque_nm"), joint.rated_torque_nm, 1e-3..=4e6);
    Some(Joint {
        name: joint.name.clone(),
        channel: channel?,
        node: node?,
        identity,
        eds: eds?,
        link,
        inertia,
        rotor_inertia,
        coulomb_friction,
        viscous_friction,
        counts_per_rev: joint.encoder_counts_per_rev,
        gear_ratio: joint.gear_ratio,
        zero_counts: joint.zero_counts,
        rated_torque,
        max_torque,
        torque_curve: joint.torque_curve,
        calibration: calibration?,
    })
}

/// Pose of the grip in link 6, and gravity in {0}.
pub(super) fn grip_and_gravity(
    arm: &raw::Arm,
    problems: &mut Problems<'_>,
) -> (Isometry3<f64>, [f64; 3]) {
    let [x, y, z] = problems.all_finite("arm.grip_m", arm.grip_m);
    let [about_x, about_y, about_z] = problems.all_finite("arm.grip_rad", arm.grip_rad);
    let gravity = problems.all_finite("arm.gravity_m_per_s2", arm.gravity_m_per_s2);
    let x_6_g = Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(about_x, about_y, about_z),
    );
    (x_6_g, gravity)
}

/// Encoders and torque curves of all joints.
pub(super) fn calibration(joints: &[Joint; 6]) -> Calibration<6> {
    Calibration::new(joints.each_ref().map(|joint| joint.calibration))
}
