//! Node plans: identity, PDOs and settings of every node of a configuration, as its master takes them.

use std::f64::consts::TAU;

use crate::buses::Layout;
use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::shown_mode;
use crate::switch_box::SwitchBox;
use crate::torque_limit::TorqueLimit;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::layout::{self, Direction, Group, Pdo};
use canopen::listening::{self, Pattern};
use canopen::load::lacks;
use canopen::nameplate::Nameplate;
use canopen::nameplate::units::{SiUnit, Units};
use canopen::object::Object;
use canopen::plan::{NodePlan, ShownMode, Watch};
use canopen::{NodeId, Value, emcy};
use controller::JointVector;
use units::numbering::Joint;

/// Speed limit in the drive over the speed at which the node stops: the second layer.
const SECOND_LAYER: f64 = 1.25;

/// Maximum motion of a joint at rest in 100 ms, in rad (m): no faster than 0.02 rad/s.
const AT_REST: f64 = 0.002;

/// Counts that an encoder at rest goes back and forth.
const NOISE: u32 = 2;

impl Parameters {
    /// Plans of all nodes, in the order of the joints, then the switch box, if there is one.
    pub fn node_plans(&self) -> Vec<(Channel, NodePlan)> {
        let joints = Joint::ALL.into_iter().zip(&self.joints);
        let drives = joints.map(|(number, joint)| (joint.channel, drive(self, number, joint)));
        let inputs = self.switches.iter().map(|box_| (box_.channel, switches(self, box_)));
        drives.chain(inputs).collect()
    }

    /// Frames that a master must receive from each bus, in the order of the channels.
    pub fn patterns(&self) -> Vec<Vec<Pattern>> {
        let plans = self.node_plans();
        self.channels().into_iter().map(|channel| listening::patterns(channel, &plans)).collect()
    }
}

/// The plan of a joint's drive.
pub(super) fn drive(config: &Parameters, number: Joint, joint: &JointParameters) -> NodePlan {
    let place = number.index();
    let name = format!("joint {number} ({})", joint.name);
    let timer = rpdo_timer(config, joint);
    let group = group(config, joint);
    let mut pdos = match group {
        Some(group) => layout::grouped(joint.node, place, group, timer),
        None => layout::per_drive(joint.node, timer),
    };
    layout::switch_off_others(&mut pdos, |object| joint.eds.object(object).is_some());
    layout::keep_bit_30(&mut pdos, |object| default(&joint.eds, object, joint.node));
    if group.is_none() && timer.is_none_or(|millis| millis == 0) {
        send_demand(&mut pdos, joint);
    }
    let most = joint.calibration.max_target().0.unsigned_abs();
    let watch = watch(config, place);
    let plan = NodePlan::drive(name, joint.node, joint.identity, pdos, &watch, most);
    let rest = joint.calibration.span(AT_REST).saturating_add(NOISE);
    let nameplate = Some(nameplate(config, place, joint, most));
    let plan = NodePlan { standstill_counts: Some(rest), nameplate, ..plan };
    let plan = match &joint.torque_limit {
        Some(limit) => plan.limited_by(limit.writes()),
        None => plan,
    };
    let plan = plan.no_faster_than(motor_speed(config, place, joint));
    let plan = match config.sync_counter {
        Some(last) => plan.counting(last),
        None => plan,
    };
    let plan = plan.every(config.period_us().into());
    let plan = as_far_as_it_has(plan, joint);
    let plan = NodePlan {
        shown_mode: shown_mode(joint, most),
        emcy_warnings: joint.emcy_warnings.clone(),
        ..plan
    };
    kept(config, &joint.eds, joint.boot.apply(behind_the_pdos(plan, &joint.eds)))
}

/// When the drive displays its mode, and its torque limits until then.
fn shown_mode(joint: &JointParameters, most: u16) -> ShownMode {
    if !joint.boot.shows_mode_when_enabled {
        return ShownMode::Always;
    }
    let usual = [(Object::MAX_TORQUE, Value::Unsigned16(most))];
    let limits = joint.torque_limit.as_ref().map_or(&usual[..], TorqueLimit::writes);
    let reduced_limits = shown_mode::reduced(limits).unwrap_or_default();
    ShownMode::WhenEnabled { reduced_limits }
}

/// Has the drive send its torque demand in the first free TPDO that it can have, by its EDS. The bus of a group has no
/// room for it.
fn send_demand(pdos: &mut [Pdo], joint: &JointParameters) {
    let is_free = |pdo: &&mut Pdo| {
        pdo.direction == Direction::Transmit && pdo.service.is_none() && pdo.cob_id != 0
    };
    for pdo in pdos.iter_mut().filter(is_free) {
        pdo.service = Some(layout::torque_demand());
        if lacks::lacks(&joint.eds, joint.node, std::slice::from_ref(pdo)).is_empty() {
            return;
        }
        pdo.service = None;
    }
}

/// Returns the values that the drive of a joint must hold, by the whole configuration.
fn nameplate(config: &Parameters, place: usize, joint: &JointParameters, most: u16) -> Nameplate {
    let writes_speed = is_writable(&joint.eds, Object::MAX_MOTOR_SPEED);
    let units = Units {
        velocity: writes_speed.then_some(SiUnit::RPM),
        range: counts_of_range(config, place),
        ..joint.nameplate.units.clone()
    };
    Nameplate { capacity: Some(most), units, ..joint.nameplate.clone() }
}

/// Lowest and highest count of the drive at `place` where every joint is within its range: at the corners of the ranges,
/// as a coupling is linear.
fn counts_of_range(config: &Parameters, place: usize) -> Option<[i32; 2]> {
    let ranges = config.joints.each_ref().map(|joint| joint.plant.link.range);
    let corners = (0..1_u32 << ranges.len()).filter_map(|corner| {
        let ends = (0..)
            .zip(ranges)
            .map(|(at, [low, high])| if corner >> at & 1 == 0 { low } else { high });
        let q = JointVector::from_iterator(ends);
        config.controller.calibration.counts(&q).get(place).map(|counts| counts.0)
    });
    let (low, high) = corners.clone().min().zip(corners.max())?;
    Some([low, high])
}

/// The drives that share a joint's frame of targets; `None` where each has its own.
fn group(config: &Parameters, joint: &JointParameters) -> Option<Group> {
    let bus = config.buses.get(usize::from(joint.channel.0))?;
    if bus.layout != Layout::Grouped {
        return None;
    }
    let here = config.joints.iter().filter(|other| other.channel == joint.channel);
    let nodes: Vec<NodeId> = here.map(|other| other.node).collect();
    let groups = nodes.iter().zip(Group::threes(&nodes));
    groups.into_iter().find_map(|(node, group)| (*node == joint.node).then_some(group))
}

/// With its emergencies behind the PDOs, where the device lets them be moved: by default they outrank
/// every PDO, and six at once would keep the torques off the bus for most of a millisecond.
fn behind_the_pdos(plan: NodePlan, eds: &Eds) -> NodePlan {
    let low = emcy::low_cob_id(plan.node).filter(|_| is_writable(eds, Object::EMCY_COB_ID));
    NodePlan { emcy_cob_id: low.unwrap_or(plan.emcy_cob_id), ..plan }
}

/// The plan of the switch box.
pub(super) fn switches(config: &Parameters, switches: &SwitchBox) -> NodePlan {
    let SwitchBox { node, identity, boot, eds, gripper, .. } = switches;
    let mut plan = NodePlan::switches(
        "switch box".to_owned(),
        *node,
        *identity,
        gripper.and_then(|input| input.analogue_input()),
        &watch(config, config.joints.len()),
    );
    layout::switch_off_others(&mut plan.pdos, |object| eds.object(object).is_some());
    layout::keep_bit_30(&mut plan.pdos, |object| default(eds, object, *node));
    kept(config, eds, boot.apply(behind_the_pdos(plan, eds)))
}

/// Adds storing and restoring of the configuration, as the file asks. A node that cannot restore defaults by its EDS
/// has nothing to forget.
fn kept(config: &Parameters, eds: &Eds, plan: NodePlan) -> NodePlan {
    let can_forget = eds.object(Object::RESTORE_DEFAULTS).is_some();
    NodePlan {
        stores_configuration: config.stores_configuration,
        restores_defaults: config.restores_defaults && can_forget,
        ..plan
    }
}

/// Error control of the node at `place`. Each beats a hundredth faster than the one before, so that those
/// of all nodes, which begin together, do not stay together: the next SYNC would have to wait for them.
fn watch(config: &Parameters, place: usize) -> Watch {
    let place = u16::try_from(place).unwrap_or(u16::MAX);
    let period = config.safety.drive_heartbeat_ms;
    let lost = u16::try_from(config.safety.drive_lost.as_millis()).unwrap_or(u16::MAX);
    Watch {
        master: config.node_id,
        master_lost_ms: config.safety.node_lost_ms,
        heartbeat_ms: period - (period / 100).saturating_mul(place).min(period / 2),
        node_lost_ms: lost,
    }
}

/// The fastest the motor of an actuator may turn (6080h), in turns per minute, rounded up, where no joint
/// behind it is faster than it may be.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "finite and not negative by its checks; a float that is too large becomes the largest number"
)]
fn motor_speed(config: &Parameters, place: usize, joint: &JointParameters) -> u32 {
    let speeds = JointVector::from(config.joints.each_ref().map(|joint| joint.max_speed));
    let speeds = config.controller.calibration.coupling().fastest(&speeds);
    let fastest = SECOND_LAYER * speeds.iter().nth(place).copied().unwrap_or_default();
    (fastest * joint.plant.actuator.gear_ratio.abs() / TAU * 60.0).ceil() as u32
}

/// Without what a drive of this EDS has not, or not for writing, and need not have.
fn as_far_as_it_has(plan: NodePlan, joint: &JointParameters) -> NodePlan {
    plan.lacking(|object| !is_writable(&joint.eds, object))
}

fn is_writable(eds: &Eds, object: Object) -> bool {
    eds.object(object).is_some_and(|described| described.access.is_writable())
}

/// The default of a COB-ID.
fn default(eds: &Eds, object: Object, node: NodeId) -> Option<u32> {
    let number = eds.object(object)?.number?;
    u32::try_from(number.resolve(node)).ok()
}

/// Time until a drive without a fresh RPDO stops, if it has such a timer by its EDS; written as 0 where the file wants
/// none.
fn rpdo_timer(config: &Parameters, joint: &JointParameters) -> Option<u16> {
    let timer = Object::rpdo_communication(1, 5);
    is_writable(&joint.eds, timer).then_some(config.safety.rpdo_timer_ms)
}
