//! Configuration of a network in the terms of the monitor, computed once.

use std::time::Duration;

use crate::monitor::drive_timers::DriveTimers;
use canopen::exchange::TpdoMap;
use canopen::frame::{Channel, Frame};
use canopen::layout::{Direction, MappedObject, Pdo};
use canopen::object::Object;
use canopen::plan::{Identity, NodePlan};
use canopen::{NodeId, nmt, sync, time_stamp};
use config::{Actuator, Config};
use sim::actuator::TorqueCurve;
use sim::arm::{Arm, Joints};
use testbench::world;
use units::drive::Counts;
use units::numbering::{Joint, NodeIndex};

/// COB-ID of an SDO request, before the node-id is added (CiA 301, 7.3.3).
pub(super) const SDO_REQUEST: u16 = 0x600;
/// COB-ID of an SDO response.
pub(super) const SDO_REPLY: u16 = 0x580;
/// COB-ID of heartbeat, boot-up message and node guarding.
pub(super) const ERROR_CONTROL: u16 = 0x700;

/// COB-IDs, bounds and timers of a network, from its configuration.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) period: Duration,
    /// Bitrate of each bus, in bit/s.
    pub(super) bitrates: Vec<u32>,
    /// TPDOs of all nodes.
    pub(super) tpdos: TpdoMap,
    pub(super) rpdos: Vec<Rpdo>,
    /// Drives of the joints, then the switch box.
    pub(super) nodes: Vec<Member>,
    pub(super) joints: [JointSheet; 6],
    /// COB-ID of the master's heartbeat.
    pub(super) heartbeat: u16,
    /// Buses and COB-IDs of all frames that the node may send.
    own: Vec<(Channel, u16)>,
    config: Config,
    arm: Arm,
}

/// Node with its identity, EMCY COB-ID and timers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub(super) channel: Channel,
    pub(super) node: NodeId,
    pub(super) identity: Identity,
    /// COB-ID of its emergency messages.
    pub(super) emergency: u16,
    pub(super) timers: DriveTimers,
}

/// Bounds of one joint's target.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointSheet {
    /// Largest target, in ‰ of rated torque.
    pub(super) cap: i16,
    /// Largest growth per cycle, in N·m (N).
    pub(super) growth: f64,
    /// Largest torque, in N·m (N).
    pub(super) capacity: f64,
    /// Largest torque of one ‰, in N·m (N).
    pub(super) resolution: f64,
    curve: TorqueCurve,
    range: [f64; 2],
}

/// RPDO with commands of drives.
#[derive(Clone, Debug)]
pub(super) struct Rpdo {
    pub(super) channel: Channel,
    pub(super) cob_id: u16,
    /// Sent once for each SYNC.
    pub(super) is_cyclic: bool,
    /// Joint, object and first bit of each command; targets first.
    fields: Vec<(Joint, Object, u32)>,
}

impl Sheet {
    pub(super) fn new(config: &Config) -> Self {
        let plans = config.node_plans();
        let nodes: Vec<Member> = plans.iter().map(Member::from_plan).collect();
        let rpdos = rpdos(&plans);
        let tpdos = config.exchange().tpdos.clone();
        let heartbeat = ERROR_CONTROL + u16::from(config.node_id.raw());
        let mut own: Vec<(Channel, u16)> =
            rpdos.iter().map(|rpdo| (rpdo.channel, rpdo.cob_id)).collect();
        for channel in config.channels() {
            own.extend([nmt::COB_ID, sync::COB_ID, heartbeat].map(|cob_id| (channel, cob_id)));
            own.extend(config.time_period.map(|_| (channel, time_stamp::COB_ID)));
        }
        for Member { channel, node, .. } in &nodes {
            own.push((*channel, SDO_REQUEST + u16::from(node.raw())));
        }
        let slew = config.controller.extensions.slew;
        let growth = slew.map_or(Joints::repeat(f64::INFINITY), |slew| *slew.rise());
        let mut growth = growth.iter().copied();
        let joints = config.joints.each_ref().map(|joint| JointSheet {
            cap: joint.calibration.max_target().0,
            growth: growth.next().unwrap_or(f64::INFINITY),
            capacity: joint.plant.actuator.max_torque,
            resolution: resolution(&joint.plant.actuator),
            curve: TorqueCurve::new(&world::actuator(&joint.plant.actuator)),
            range: joint.plant.link.range,
        });
        let bitrates = config.buses.iter().map(|bus| bus.bitrate).collect();
        let (arm, config) = (world::arm(&config.plant()), config.clone());
        let period = config.period;
        Self { period, bitrates, tpdos, rpdos, nodes, joints, heartbeat, own, config, arm }
    }

    /// Returns whether the node may send this frame.
    pub(super) fn is_own(&self, channel: Channel, frame: &Frame) -> bool {
        if frame.is_remote() {
            self.guarded(channel, frame).is_some()
        } else {
            self.own.contains(&(channel, frame.cob_id))
        }
    }

    /// Returns the node that is guarded by this remote frame.
    pub(super) fn guarded(&self, channel: Channel, frame: &Frame) -> Option<NodeIndex> {
        let is_guarded =
            |node: &NodeIndex| self.nodes.get(node.0).is_some_and(|it| it.timers.is_guarded());
        let node = self.node(channel, frame.cob_id, ERROR_CONTROL).filter(is_guarded);
        node.filter(|_| frame.is_remote())
    }

    /// Returns the RPDO with this frame's COB-ID, and its index.
    pub(super) fn rpdo(&self, channel: Channel, frame: &Frame) -> Option<(usize, &Rpdo)> {
        let is_it =
            |(_, rpdo): &(usize, &Rpdo)| rpdo.channel == channel && rpdo.cob_id == frame.cob_id;
        self.rpdos.iter().enumerate().find(is_it)
    }

    /// Returns the node with this COB-ID, which is `base` plus node-id.
    pub(super) fn node(&self, channel: Channel, cob_id: u16, base: u16) -> Option<NodeIndex> {
        let is_it = |member: &Member| {
            member.channel == channel && base + u16::from(member.node.raw()) == cob_id
        };
        self.nodes.iter().position(is_it).map(NodeIndex)
    }

    /// Returns the node with this COB-ID of emergency messages.
    pub(super) fn emergency_producer(&self, channel: Channel, cob_id: u16) -> Option<NodeIndex> {
        let is_it = |member: &Member| member.channel == channel && member.emergency == cob_id;
        self.nodes.iter().position(is_it).map(NodeIndex)
    }

    /// Returns the gravity torques of the actuators at these positions, in N·m (N), and whether each joint is near an end
    /// of its range.
    pub(super) fn weight(&self, counts: &[i32; 6]) -> ([f64; 6], [bool; 6]) {
        let calibration = &self.config.controller.calibration;
        let q = calibration.positions(&counts.map(Counts));
        let gravity = self.arm.gravity(&self.arm.posture(&q));
        let gravity = calibration.coupling().matrix().transpose() * gravity;
        let mut ends = [false; 6];
        for ((is_near, joint), q) in ends.iter_mut().zip(&self.joints).zip(q.iter()) {
            let [low, high] = joint.range;
            let margin = NEAR * (high - low);
            *is_near = *q < low + margin || *q > high - margin;
        }
        (gravity.into(), ends)
    }
}

/// Share of a range in which soft stops may act.
const NEAR: f64 = 0.06;

impl Member {
    fn from_plan((channel, plan): &(Channel, NodePlan)) -> Self {
        Self {
            channel: *channel,
            node: plan.node,
            identity: plan.identity,
            emergency: plan.emcy_cob_id,
            timers: DriveTimers::from_plan(plan),
        }
    }
}

impl JointSheet {
    /// Returns the magnitude of a target's torque, in N·m (N).
    pub(super) fn torque(&self, target: i16) -> f64 {
        self.curve.torque(f64::from(target)).abs()
    }
}

/// Returns the largest torque of one ‰ on `c1 t + c3 t³ + c5 t⁵`: the inverse of its least slope.
fn resolution(actuator: &Actuator) -> f64 {
    let ([c1, c3, c5], max) = (actuator.torque_curve, actuator.max_torque);
    let slope = |step: u32| {
        let squared = (max * f64::from(step) / f64::from(STEPS)).powi(2);
        c1 + 3.0 * c3 * squared + 5.0 * c5 * squared.powi(2)
    };
    1.0 / (0..=STEPS).map(slope).fold(f64::INFINITY, f64::min)
}

/// Number of steps of a torque curve at which its slope is read.
const STEPS: u32 = 1_000;

impl Rpdo {
    /// Returns its commands, targets first.
    pub(super) fn read<'a>(&'a self, frame: &'a Frame) -> impl Iterator<Item = Command> + 'a {
        let content = frame.data().iter().rev();
        let content = content.fold(0_u64, |content, byte| content << 8 | u64::from(*byte));
        self.fields.iter().map(move |(joint, object, shift)| {
            let [low, high, ..] = content.unbounded_shr(*shift).to_le_bytes();
            let word = u16::from_le_bytes([low, high]);
            match *object == Object::TARGET_TORQUE {
                true => Command::Target(*joint, i16::from_le_bytes([low, high])),
                false => Command::Controlword(*joint, word),
            }
        })
    }
}

/// Command of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    Target(Joint, i16),
    Controlword(Joint, u16),
}

fn rpdos(plans: &[(Channel, NodePlan)]) -> Vec<Rpdo> {
    let mut rpdos: Vec<Rpdo> = Vec::new();
    for (joint, (channel, plan)) in Joint::ALL.into_iter().zip(plans) {
        let used = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive);
        for (pdo, service) in used.filter_map(|pdo| Some((pdo, pdo.service.as_ref()?))) {
            let is_cyclic = service.transmission.syncs().is_some();
            let fields = fields(joint, &service.mapping);
            match rpdos.iter_mut().find(|rpdo| is_same(rpdo, *channel, pdo)) {
                Some(rpdo) => rpdo.fields.extend(fields),
                None => rpdos.push(Rpdo {
                    channel: *channel,
                    cob_id: pdo.cob_id,
                    is_cyclic,
                    fields: fields.collect(),
                }),
            }
        }
    }
    let is_word = |field: &(Joint, Object, u32)| field.1 != Object::TARGET_TORQUE;
    rpdos.iter_mut().for_each(|rpdo| rpdo.fields.sort_by_key(is_word));
    rpdos
}

fn is_same(rpdo: &Rpdo, channel: Channel, pdo: &Pdo) -> bool {
    (rpdo.channel, rpdo.cob_id) == (channel, pdo.cob_id)
}

/// Returns targets and controlwords of a mapping, with the first bit of each.
fn fields(joint: Joint, mapping: &[MappedObject]) -> impl Iterator<Item = (Joint, Object, u32)> {
    let mut shift = 0;
    mapping.iter().filter_map(move |mapped| {
        let at = shift;
        shift += u32::from(mapped.bits);
        let is_wanted = [Object::TARGET_TORQUE, Object::CONTROLWORD].contains(&mapped.object);
        is_wanted.then_some((joint, mapped.object, at))
    })
}
