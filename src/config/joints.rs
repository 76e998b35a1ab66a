//! `[[joint]]`: drive, maximum speed, calibration and plant of each joint.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::boot::{self, BootSettings, OtherSections};
use crate::plant::{Actuator, JointPlant};
use crate::problem::Problems;
use crate::rest::Rest;
use crate::torque_limit::{self, TorqueLimit};
use crate::units::Units;
use crate::value::Value;
use crate::zero::{Zero, ZeroSource};
use crate::{joint_plant, lookup, nameplate, names, plausibility, raw, rest, zero};
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::fact::Fact;
use canopen::frame::Channel;
use canopen::nameplate::Nameplate;
use canopen::plan::Identity;
use controller::arm::JointKind;
use controller::calibration::{JointCalibration, TorqueCurve};

/// One joint: its drive on the network, its limits, its calibration and its plant.
#[derive(Clone, Debug)]
pub struct JointParameters {
    /// Displayed name, unique among the joints.
    pub name: String,
    /// Bus of the drive.
    pub channel: Channel,
    /// Node-id of the drive.
    pub node: NodeId,
    /// Identity that the drive must report (1018h).
    pub identity: Identity,
    /// Boot of the drive.
    pub boot: BootSettings,
    /// EDS of the drive.
    pub eds: Arc<Eds>,
    /// Sign, scale and ratings that the drive must have stored.
    pub nameplate: Nameplate,
    /// Facts of the drive that are accepted without verification by an object.
    pub accepted: Vec<Fact>,
    /// EMCY error codes that are warnings while the error register is 0.
    pub emcy_warnings: Vec<u16>,
    /// Where the zero of the joint comes from.
    pub zero: Zero,
    /// Rest position, if configured.
    pub rest: Option<Rest>,
    /// Position that verifies sign and scale once the rest position has set the zero, if configured.
    pub second_rest: Option<Rest>,
    /// Torque limit of the drive in place of 6072h.
    pub torque_limit: Option<TorqueLimit>,
    /// Maximum speed before the torque is switched off, in rad/s or m/s.
    pub max_speed: f64,
    /// Encoder and torque curve, for the controller.
    pub calibration: JointCalibration,
    /// Link, friction and actuator, for simulation and checks.
    pub plant: JointPlant,
}

/// Reads all six joints. Returns `None` after a problem.
pub(super) fn read(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<[JointParameters; 6]> {
    let mut joints = Vec::new();
    let given = raw.joint.all();
    names::check(given.iter().map(|joint| &joint.name), problems);
    for joint in given {
        joints.push(read_one(file, raw, joint, problems));
    }
    if given.len() != 6 && !raw.joint.is_noted() {
        let found = given.len();
        problems.add(&raw.joint, format_args!("{found} joints; a hand controller has 6"));
    }
    let joints: Vec<JointParameters> = joints.into_iter().collect::<Option<_>>()?;
    joints.try_into().ok()
}

fn read_one(
    file: &Path,
    raw: &raw::File,
    joint: &raw::Joint,
    problems: &mut Problems<'_>,
) -> Option<JointParameters> {
    let channel = lookup::channel(&joint.bus, raw, problems);
    let node = lookup::node_id(&joint.node_id, problems);
    let eds = lookup::eds(&joint.eds, file, problems);
    let limit = joint.torque_limit.as_ref();
    let limit = limit.and_then(|limit| torque_limit::read(limit, eds.as_deref(), problems));
    let given = OtherSections {
        lost_ms: raw.safety.drive_lost_ms.get(),
        eds: eds.as_deref(),
        period: raw.node.sync_period_us.get().map(Duration::from_micros),
        limit: limit.as_ref(),
    };
    let boot = boot::of_drive(joint.boot.as_ref(), given, problems);
    let nameplate = nameplate::read(joint, eds.as_deref(), problems);
    let accepted = nameplate::accepted(joint, problems);
    let kinds = [("revolute", JointKind::Revolute), ("prismatic", JointKind::Prismatic)];
    let kind = problems.one_of(&joint.kind.or("revolute".to_owned()), &kinds)?;

    // An invalid torque is reported, not the curve that depends on it.
    let before = problems.count();
    let mut of = Units { kind, problems };
    let max_speed = max_speed(joint, &plausibility::default_speed(&raw.safety, kind), &mut of);
    let drive = zero::Drive { eds: eds.as_deref(), limit: limit.as_ref(), boot: &boot };
    let zero = zero::read(joint, drive, of.problems);
    let counts = zero.and_then(|zero| zero::counts(joint, zero.source, of.problems));
    let actuator = joint_plant::actuator(joint, counts, &mut of);
    let calibration =
        actuator.and_then(|actuator| calibration(joint, &actuator, before, of.problems));
    let range = joint_plant::range(joint, &mut of);
    let source = zero.map_or(ZeroSource::Absolute, |zero| zero.source);
    let rest = range.and_then(|range| rest::read(joint, range, source, &mut of));
    let second_rest = range.and_then(|range| rest::read_second(joint, range, source, &mut of));
    let plant = joint_plant::read(joint, range, rest, actuator, &mut of);
    Some(JointParameters {
        name: joint.name.as_ref()?.clone(),
        channel: channel?,
        node: node?,
        identity: Identity {
            vendor: joint.vendor_id.get()?,
            product: joint.product_code.get()?,
            revision: joint.revision.get()?,
        },
        boot,
        eds: eds?,
        nameplate: nameplate?,
        accepted,
        emcy_warnings: emcy_warnings(joint, problems),
        zero: zero?,
        rest,
        second_rest,
        torque_limit: limit,
        max_speed: max_speed?,
        calibration: calibration?,
        plant: plant?,
    })
}

/// Reads the EMCY error codes that are warnings while the error register is 0. Error reset (00xxh) is refused.
fn emcy_warnings(joint: &raw::Joint, problems: &mut Problems<'_>) -> Vec<u16> {
    let codes = joint.emcy_warnings.as_ref().cloned().unwrap_or_default();
    if codes.iter().any(|code| code >> 8 == 0) {
        problems.add(&joint.emcy_warnings, "00xxh is an error reset, not a code");
    }
    codes
}

/// Reads the maximum speed, in rad/s or m/s; `usual` if the key is absent.
fn max_speed(joint: &raw::Joint, usual: &Value<f64>, of: &mut Units<'_, '_>) -> Option<f64> {
    let given = of.at_most_one(&joint.max_speed_rad_per_s, &joint.max_speed_m_per_s)?;
    if given.is_absent() {
        usual.get()
    } else {
        of.problems.within(given, plausibility::MAX_SPEED_RANGE)
    }
}

/// Returns the calibration of an actuator. Suppresses problems of the curve if others were noted since `before`.
fn calibration(
    joint: &raw::Joint,
    actuator: &Actuator,
    before: usize,
    problems: &mut Problems<'_>,
) -> Option<JointCalibration> {
    let Actuator { counts_per_rev, gear_ratio, zero_counts, .. } = *actuator;
    let curve = TorqueCurve::new(actuator.torque_curve, actuator.max_torque);
    let curve = problems.take_unless_noted(before, &joint.torque_curve, curve)?;
    let made = JointCalibration::new(counts_per_rev, gear_ratio, zero_counts, curve);
    problems.take(&joint.gear_ratio, made)
}
