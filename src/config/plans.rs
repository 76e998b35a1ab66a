//! Node plans for the master: identity, PDOs and settings of every configured node.

use std::f64::consts::TAU;

use crate::buses::Layout;
use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::shown_mode;
use crate::switch_box::SwitchBox;
use crate::torque_limit::TorqueLimit;
use crate::zero::ZeroSource;
use crate::zeroing::Zeroing;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::layout::{self, Direction, Group, Pdo};
use canopen::listening::{self, Pattern};
use canopen::load::lacks;
use canopen::nameplate::Nameplate;
use canopen::nameplate::units::{SiUnit, Units};
use canopen::object::Object;
use canopen::plan::{HeartbeatSettings, HomingPlan, NodePlan, ShownMode};
use canopen::{NodeId, Value, emcy};
use controller::JointVector;
use units::numbering::Joint;

/// Ratio of the speed limit in the drive (6080h) to the speed at which the node stops.
const SECOND_LAYER: f64 = 1.25;

/// Maximum motion of a joint at standstill in 100 ms, in rad or m: 0.02 rad/s.
const STANDSTILL: f64 = 0.002;

/// Noise of an encoder at standstill, in counts.
const NOISE: u32 = 2;

impl Parameters {
    /// Returns the plans of all nodes: of the drives in the order of the joints, then of the switch box, if configured.
    pub fn node_plans(&self) -> Vec<(Channel, NodePlan)> {
        let joints = Joint::ALL.into_iter().zip(&self.joints);
        let drives = joints.map(|(number, joint)| (joint.channel, drive(self, number, joint)));
        let inputs = self.switches.iter().map(|box_| (box_.channel, switches(self, box_)));
        drives.chain(inputs).collect()
    }

    /// Returns patterns of the frames that the master must receive, for each bus in the order of the channels.
    pub fn patterns(&self) -> Vec<Vec<Pattern>> {
        let plans = self.node_plans();
        self.channels().into_iter().map(|channel| listening::patterns(channel, &plans)).collect()
    }
}

/// Returns the plan of a drive: PDO layout of its bus, torque and speed limits, nameplate, error control.
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
    let heartbeats = heartbeats(config, place);
    let plan = NodePlan::drive(name, joint.node, joint.identity, pdos, &heartbeats, most);
    let rest = joint.calibration.span(STANDSTILL).saturating_add(NOISE);
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
        homing: homing(config, number, joint, most),
        emcy_warnings: joint.emcy_warnings.clone(),
        ..plan
    };
    kept(config, &joint.eds, joint.boot.apply(behind_the_pdos(plan, &joint.eds)))
}

/// Returns when the drive displays its mode (6061h), with the reduced torque limits until then.
fn shown_mode(joint: &JointParameters, most: u16) -> ShownMode {
    if !joint.boot.shows_mode_when_enabled {
        return ShownMode::Always;
    }
    ShownMode::WhenEnabled { reduced_limits: reduced_limits(joint, most) }
}

/// Returns the homing of a drive whose zero comes from it: at home 6064h reads the counts of the rest position.
fn homing(
    config: &Parameters,
    number: Joint,
    joint: &JointParameters,
    most: u16,
) -> Option<HomingPlan> {
    let ZeroSource::Homing(homing) = joint.zero.source else { return None };
    let has_offset = is_writable(&joint.eds, Object::HOME_OFFSET);
    Some(HomingPlan {
        method: homing.method,
        offset: has_offset.then(|| Zeroing::new(config).rest_counts(number).0),
        reduced_limits: reduced_limits(joint, most),
    })
}

/// Returns the torque limits of a drive, at most 5 % of rated torque each; empty if no object limits it.
fn reduced_limits(joint: &JointParameters, most: u16) -> Vec<(Object, Value)> {
    let usual = [(Object::MAX_TORQUE, Value::Unsigned16(most))];
    let limits = joint.torque_limit.as_ref().map_or(&usual[..], TorqueLimit::writes);
    shown_mode::reduced(limits).unwrap_or_default()
}

/// Maps the torque demand (6074h) to the first free TPDO that the EDS allows. A bus with grouped layout has no room for
/// it.
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

/// Returns the nameplate that the drive of a joint must have, with capacity, units and range.
fn nameplate(config: &Parameters, place: usize, joint: &JointParameters, most: u16) -> Nameplate {
    let writes_speed = is_writable(&joint.eds, Object::MAX_MOTOR_SPEED);
    let units = Units {
        velocity: writes_speed.then_some(SiUnit::RPM),
        range: counts_of_range(config, place).map(|range| possible_counts(joint, range)),
    };
    Nameplate { capacity: Some(most), units, ..joint.nameplate.clone() }
}

/// Returns the lowest and highest count of the drive at `place` over the ranges of all joints. A coupling is linear, so
/// the corners of the ranges suffice.
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

/// Returns the counts that a drive may read, whose joint has this range in counts from its zero. One that counts from power-up
/// may do so at any posture.
fn possible_counts(joint: &JointParameters, [low, high]: [i32; 2]) -> [i32; 2] {
    let width = high.saturating_sub(low);
    match joint.zero.source {
        ZeroSource::Absolute | ZeroSource::Homing(_) => [low, high],
        ZeroSource::Rest => [-width, width],
        ZeroSource::SingleTurn { counts } => {
            [-width, joint.calibration.whole_counts(counts).saturating_add(width)]
        }
    }
}

/// Returns the group of drives that share one RPDO of target torques; `None` if each drive has its own.
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

/// Returns the plan with an EMCY COB-ID (1014h) behind the PDOs, if it is writable. The default outranks every PDO, and
/// six EMCY messages at once would delay the target torques by most of a millisecond.
fn behind_the_pdos(plan: NodePlan, eds: &Eds) -> NodePlan {
    let low = emcy::low_cob_id(plan.node).filter(|_| is_writable(eds, Object::EMCY_COB_ID));
    NodePlan { emcy_cob_id: low.unwrap_or(plan.emcy_cob_id), ..plan }
}

/// Returns the plan of the switch box: its inputs by TPDO, without a heartbeat consumer.
pub(super) fn switches(config: &Parameters, switches: &SwitchBox) -> NodePlan {
    let SwitchBox { node, identity, boot, eds, gripper, .. } = switches;
    let mut plan = NodePlan::switches(
        "switch box".to_owned(),
        *node,
        *identity,
        gripper.and_then(|input| input.analogue_input()),
        &heartbeats(config, config.joints.len()),
    );
    layout::switch_off_others(&mut plan.pdos, |object| eds.object(object).is_some());
    layout::keep_bit_30(&mut plan.pdos, |object| default(eds, object, *node));
    kept(config, eds, boot.apply(behind_the_pdos(plan, eds)))
}

/// Returns the plan with storing (1010h) and restoring (1011h) of parameters as configured. Restoring is skipped if the
/// EDS lacks 1011h.
fn kept(config: &Parameters, eds: &Eds, plan: NodePlan) -> NodePlan {
    let can_forget = eds.object(Object::RESTORE_DEFAULTS).is_some();
    NodePlan {
        stores_configuration: config.stores_configuration,
        restores_defaults: config.restores_defaults && can_forget,
        ..plan
    }
}

/// Returns the error control of the node at `place`. Each heartbeat period is 1 % of the configured one shorter than
/// the one before. Heartbeats that start together drift apart, and do not delay a SYNC together.
fn heartbeats(config: &Parameters, place: usize) -> HeartbeatSettings {
    let place = u16::try_from(place).unwrap_or(u16::MAX);
    let period = config.safety.drive_heartbeat_ms;
    let lost = u16::try_from(config.safety.drive_lost.as_millis()).unwrap_or(u16::MAX);
    HeartbeatSettings {
        master: config.node_id,
        master_lost_ms: config.safety.node_lost_ms,
        heartbeat_ms: period - (period / 100).saturating_mul(place).min(period / 2),
        node_lost_ms: lost,
    }
}

/// Returns the maximum motor speed (6080h), in revolutions per minute, rounded up. It allows the maximum speeds of all
/// joints that the motor moves, times [`SECOND_LAYER`].
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

/// Returns the plan without the optional objects that the EDS lacks or has as read-only.
fn as_far_as_it_has(plan: NodePlan, joint: &JointParameters) -> NodePlan {
    plan.lacking(|object| !is_writable(&joint.eds, object))
}

fn is_writable(eds: &Eds, object: Object) -> bool {
    eds.object(object).is_some_and(|described| described.access.is_writable())
}

/// Returns the default value of a COB-ID in the EDS.
fn default(eds: &Eds, object: Object, node: NodeId) -> Option<u32> {
    let number = eds.object(object)?.number?;
    u32::try_from(number.resolve(node)).ok()
}

/// Returns the RPDO event timer (1400h:5) in ms, 0 to disable it; `None` if the EDS has no such timer.
fn rpdo_timer(config: &Parameters, joint: &JointParameters) -> Option<u16> {
    let timer = Object::rpdo_communication(1, 5);
    is_writable(&joint.eds, timer).then_some(config.safety.rpdo_timer_ms)
}
