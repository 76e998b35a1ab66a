//! What the monitor knows of a network: its own reading of the configuration, made once.

use std::time::Duration;

use crate::world;
use canopen::NodeId;
use canopen::exchange::Inbox;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::layout::Direction;
use canopen::layout::Mapped;
use canopen::layout::Pdo;
use canopen::nmt;
use canopen::object::Object;
use canopen::plan::Identity;
use canopen::plan::NodePlan;
use canopen::sync;
use canopen::time_stamp;
use canopen::watchdog::Awaited;
use config::Config;
use controller::calibration::TorqueCurve;
use sim::arm::Arm;
use sim::arm::Joints;
use units::drive::Counts;
use units::numbering::Joint;
use units::numbering::NodeIndex;

/// Of the predefined connection set (CiA 301, 7.3.3).
pub(super) const SDO_REQUEST: u16 = 0x600;
/// The answers.
pub(super) const SDO_REPLY: u16 = 0x580;
/// Heartbeat, boot-up, and guarding.
pub(super) const ERROR_CONTROL: u16 = 0x700;

/// A network as its configuration means it.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) period: Duration,
    /// What TPDOs say.
    pub(super) inbox: Inbox,
    pub(super) rpdos: Vec<Rpdo>,
    /// The joints' drives, then the switch box.
    pub(super) nodes: Vec<Member>,
    pub(super) joints: [JointSheet; 6],
    /// The master's own heartbeat.
    pub(super) heartbeat: u16,
    /// What the node may send, and where.
    own: Vec<(Channel, u16)>,
    config: Config,
    arm: Arm,
}

/// One node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub(super) channel: Channel,
    pub(super) node: NodeId,
    pub(super) identity: Identity,
    /// Its emergencies.
    pub(super) emergency: u16,
    /// Whether it stops without RPDOs, and without heartbeats.
    pub(super) watched: [bool; 2],
}

/// What bounds one joint's target.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointSheet {
    /// The most, in ‰ of rated torque.
    pub(super) cap: i16,
    /// The most it may grow in a cycle, in N·m (N).
    pub(super) growth: f64,
    curve: TorqueCurve,
    range: [f64; 2],
}

/// A frame that tells drives something.
#[derive(Clone, Debug)]
pub(super) struct Rpdo {
    pub(super) channel: Channel,
    pub(super) cob_id: u16,
    /// It comes once for each SYNC.
    pub(super) is_cyclic: bool,
    /// Joint, what, and from which bit on; targets first.
    fields: Vec<(Joint, Object, u32)>,
}

impl Sheet {
    pub(super) fn new(config: &Config) -> Self {
        let plans = config.node_plans();
        let nodes: Vec<Member> = plans.iter().map(Member::of).collect();
        let rpdos = rpdos(&plans);
        let inbox = config.exchange().inbox.clone();
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
            curve: *joint.calibration.curve(),
            range: joint.plant.link.range,
        });
        let (arm, config) = (world::arm(&config.plant()), config.clone());
        Self { period: config.period, inbox, rpdos, nodes, joints, heartbeat, own, config, arm }
    }

    /// Whether the node may send this at all. A remote frame is how it guards one of its nodes.
    pub(super) fn is_own(&self, channel: Channel, frame: &Frame) -> bool {
        if frame.is_remote() {
            let guarded = |member: &Member| ERROR_CONTROL + u16::from(member.node.raw());
            let mut nodes = self.nodes.iter();
            return nodes
                .any(|member| member.channel == channel && guarded(member) == frame.cob_id);
        }
        self.own.contains(&(channel, frame.cob_id))
    }

    /// The frame of targets or controlwords this is, and its place among them.
    pub(super) fn rpdo(&self, channel: Channel, frame: &Frame) -> Option<(usize, &Rpdo)> {
        let is_it =
            |(_, rpdo): &(usize, &Rpdo)| rpdo.channel == channel && rpdo.cob_id == frame.cob_id;
        self.rpdos.iter().enumerate().find(is_it)
    }

    /// The node with this identifier behind `base`.
    pub(super) fn node(&self, channel: Channel, cob_id: u16, base: u16) -> Option<NodeIndex> {
        let is_it = |member: &Member| {
            member.channel == channel && base + u16::from(member.node.raw()) == cob_id
        };
        self.nodes.iter().position(is_it).map(NodeIndex)
    }

    /// The node whose emergency this is.
    pub(super) fn crying(&self, channel: Channel, cob_id: u16) -> Option<NodeIndex> {
        let is_it = |member: &Member| member.channel == channel && member.emergency == cob_id;
        self.nodes.iter().position(is_it).map(NodeIndex)
    }

    /// What carries the arm where the drives say it is, at the actuators in N·m (N), and which joints are
    /// near an end of their range.
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

/// Soft stops act within this part of a range, or less.
const NEAR: f64 = 0.06;

impl Member {
    fn of((channel, plan): &(Channel, NodePlan)) -> Self {
        let awaited = [Awaited::Rpdo, Awaited::Heartbeat];
        let watched = awaited.map(|awaited| plan.watchdog(awaited).is_some());
        Self {
            channel: *channel,
            node: plan.node,
            identity: plan.identity,
            emergency: plan.emcy_cob_id,
            watched,
        }
    }
}

impl JointSheet {
    /// The torque of a target, in N·m (N), without its sign.
    pub(super) fn torque(&self, target: i16) -> f64 {
        self.curve.torque(f64::from(target)).abs()
    }

    /// The torque of its largest target.
    pub(super) const fn capacity(&self) -> f64 {
        self.curve.max_torque()
    }

    /// What a target cannot resolve, at its coarsest.
    pub(super) fn resolution(&self) -> f64 {
        let (least, _) = self.curve.least_slope();
        1.0 / least
    }
}

impl Rpdo {
    /// What it tells whom: targets first.
    pub(super) fn read<'a>(&'a self, frame: &'a Frame) -> impl Iterator<Item = Told> + 'a {
        let content = frame.data().iter().rev();
        let content = content.fold(0_u64, |content, byte| content << 8 | u64::from(*byte));
        self.fields.iter().map(move |(joint, object, shift)| {
            let [low, high, ..] = content.unbounded_shr(*shift).to_le_bytes();
            let word = u16::from_le_bytes([low, high]);
            match *object == Object::TARGET_TORQUE {
                true => Told::Target(*joint, i16::from_le_bytes([low, high])),
                false => Told::Controlword(*joint, word),
            }
        })
    }
}

/// Something a drive is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Told {
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

/// Targets and controlwords of a mapping, with the bit each begins at.
fn fields(joint: Joint, mapping: &[Mapped]) -> impl Iterator<Item = (Joint, Object, u32)> {
    let mut shift = 0;
    mapping.iter().filter_map(move |mapped| {
        let at = shift;
        shift += u32::from(mapped.bits);
        let is_wanted = [Object::TARGET_TORQUE, Object::CONTROLWORD].contains(&mapped.object);
        is_wanted.then_some((joint, mapped.object, at))
    })
}
