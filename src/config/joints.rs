//! `[[joint]]`: the drive of each joint on the network, how fast the joint may move, and what it is made of.

use std::path::Path;

use crate::boot;
use crate::boot::BootSettings;
use crate::joint_plant;
use crate::lookup;
use crate::names;
use crate::plant::Actuator;
use crate::plant::JointPlant;
use crate::plausibility;
use crate::problem::Problems;
use crate::raw;
use crate::units::Units;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::plan::Identity;
use controller::arm::JointKind;
use controller::calibration::JointCalibration;
use controller::calibration::TorqueCurve;

/// One joint: where it is on the network, how it moves, what moves it.
#[derive(Clone, Debug)]
pub struct JointParameters {
    /// What people call it.
    pub name: String,
    /// Its drive's bus.
    pub channel: Channel,
    /// Its drive's node-id.
    pub node: NodeId,
    /// What its drive must be.
    pub identity: Identity,
    /// How its drive is booted.
    pub boot: BootSettings,
    /// What its drive's maker says of it.
    pub eds: Eds,
    /// How fast it may move before torque goes off, in rad/s or m/s.
    pub max_speed: f64,
    /// Encoder and torque curve, as the controller uses them.
    pub calibration: JointCalibration,
    /// What it is made of.
    pub plant: JointPlant,
}

/// All six joints; `None` where a problem has been noted.
pub(super) fn read(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<[JointParameters; 6]> {
    let mut joints = Vec::new();
    let called = raw.joint.iter().map(|joint| joint.name.as_str());
    names::check("joint", called, problems);
    for (place, joint) in raw.joint.iter().enumerate() {
        joints.push(read_one(file, raw, place, joint, problems));
    }
    let joints: Vec<JointParameters> = joints.into_iter().collect::<Option<_>>()?;
    let found = joints.len();
    let all = joints.try_into().ok();
    if all.is_none() {
        problems.add("joint", format_args!("{found} joints; a hand controller has 6"));
    }
    all
}

fn read_one(
    file: &Path,
    raw: &raw::File,
    place: usize,
    joint: &raw::Joint,
    problems: &mut Problems<'_>,
) -> Option<JointParameters> {
    let key = |name: &str| format!("joint[{place}].{name}");
    let channel = lookup::channel(&key("bus"), raw, &joint.bus, problems);
    let node = lookup::node_id(&key("node_id"), joint.node_id, problems);
    let eds = lookup::eds(&key("eds"), file, &joint.eds, problems);
    let lost_ms = raw.safety.drive_lost_ms;
    let boot = boot::of_drive(&key("boot"), joint.boot.as_ref(), lost_ms, problems);
    let kinds = [("revolute", JointKind::Revolute), ("prismatic", JointKind::Prismatic)];
    let kind = joint.kind.as_deref().unwrap_or("revolute");
    let kind = problems.one_of(&key("kind"), kind, &kinds)?;

    // A torque that is wrong is reported itself, not the curve up to it.
    let before = problems.count();
    let mut of = Units { key: &key, kind, problems };
    let max_speed = max_speed(joint, plausibility::usual_speed(&raw.safety, kind), &mut of);
    let actuator = joint_plant::actuator(joint, &mut of);
    let calibration =
        actuator.and_then(|actuator| calibration(&actuator, before, &key, of.problems));
    let plant = joint_plant::read(joint, actuator, &mut of);
    Some(JointParameters {
        name: joint.name.clone(),
        channel: channel?,
        node: node?,
        identity: Identity {
            vendor: joint.vendor_id,
            product: joint.product_code,
            revision: joint.revision,
        },
        boot,
        eds: eds?,
        max_speed: max_speed?,
        calibration: calibration?,
        plant: plant?,
    })
}

/// How fast it may move, in rad/s or m/s: `usual` where it does not say.
fn max_speed(joint: &raw::Joint, usual: f64, of: &mut Units<'_, '_, '_>) -> Option<f64> {
    let (name, given) = of.at_most_one(
        ("max_speed_rad_per_s", joint.max_speed_rad_per_s),
        ("max_speed_m_per_s", joint.max_speed_m_per_s),
    )?;
    let Some(speed) = given else { return Some(usual) };
    Some(of.problems.within(&(of.key)(name), speed, plausibility::SPEEDS))
}

/// The actuator as the controller uses it; silent about a curve where there have been problems since `before`.
fn calibration(
    actuator: &Actuator,
    before: usize,
    key: &dyn Fn(&str) -> String,
    problems: &mut Problems<'_>,
) -> Option<JointCalibration> {
    let Actuator { counts_per_rev, gear_ratio, zero_counts, .. } = *actuator;
    let curve = TorqueCurve::new(actuator.torque_curve, actuator.max_torque);
    let curve = problems.take_unless_noted(before, &key("torque_curve"), curve)?;
    let made = JointCalibration::new(counts_per_rev, gear_ratio, zero_counts, curve);
    problems.take(&key("gear_ratio"), made)
}
