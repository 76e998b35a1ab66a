//! Recurring frames of one bus: one [`Stream`] per COB-ID, by priority.
//!
//! An RPDO shared by several drives is one frame. Its mapping decides whether the master sends it on change (a
//! controlword) or in every cycle (a torque).

use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::{NodeId, Value};

use crate::layout::{Direction, MappedObject, Pdo, Service};
use crate::load::pace::{Pace, Values};
use crate::object::Object;
use crate::plan::{ErrorControl, NodePlan};
use crate::{bits, sync};

/// Objects that change rarely; all others count as measured values.
const RARE: [Object; 4] =
    [Object::CONTROLWORD, Object::STATUSWORD, Object::MODE_DISPLAY, Object::DIGITAL_INPUTS];

/// Data bytes of an SDO frame and of an emergency.
const FULL: u32 = 8;

/// Kind of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// SYNC message (COB-ID 80h).
    Sync,
    /// TPDO, by its number.
    Tpdo(u16),
    /// RPDO, by its number.
    Rpdo(u16),
    /// Error control frame: a heartbeat, or the poll or answer of node guarding.
    Heartbeat,
    /// EMCY message.
    Emergency,
    /// SDO request of the master.
    SdoRequest,
    /// SDO response of a node.
    SdoResponse,
}

/// Sender of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// Master of the network.
    Master,
    /// Slave with this node-id.
    Node(NodeId),
}

/// Mapped object of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Object; a dummy if no drive takes it.
    pub mapped: MappedObject,
    /// Node that sends or takes the object.
    pub node: NodeId,
}

/// Recurring frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stream {
    /// COB-ID, 11 bits: the lower one has priority.
    pub cob_id: u16,
    /// Kind.
    pub role: Role,
    /// Node or master that queues the frame.
    pub sender: Sender,
    /// Nodes that send or take it; empty for SYNC and the master's heartbeat.
    pub nodes: Vec<NodeId>,
    /// Number of data bytes.
    pub bytes: u32,
    /// Frequency.
    pub pace: Pace,
    /// Transmission at every n-th SYNC, if SYNC governs it.
    pub syncs: Option<u8>,
    /// Mapped objects of a PDO.
    pub slots: Vec<Slot>,
    /// Deadline in µs after queueing; `None` without one.
    pub deadline_us: Option<u32>,
}

impl Stream {
    /// SYNC without a counter.
    pub const fn sync(period_us: u32) -> Self {
        Self {
            cob_id: sync::COB_ID,
            role: Role::Sync,
            sender: Sender::Master,
            nodes: Vec::new(),
            bytes: 0,
            pace: Pace::Clock { period_us },
            syncs: Some(1),
            slots: Vec::new(),
            deadline_us: Some(period_us),
        }
    }

    /// Heartbeat of a node or the master; `None` if disabled. The receiver allows `lost_ms` between two of them.
    pub fn heartbeat(
        node: NodeId,
        sender: Sender,
        period_ms: u16,
        lost_ms: Option<u32>,
    ) -> Option<Self> {
        let period_us = u32::from(period_ms) * 1_000;
        let spare = lost_ms.map(|ms| ms.saturating_mul(1_000).saturating_sub(period_us));
        (period_us > 0).then(|| Self {
            cob_id: heartbeat_cob_id(node),
            role: Role::Heartbeat,
            sender,
            nodes: match sender {
                Sender::Master => Vec::new(),
                Sender::Node(node) => vec![node],
            },
            bytes: 1,
            pace: Pace::Clock { period_us },
            syncs: None,
            slots: Vec::new(),
            deadline_us: spare,
        })
    }

    /// Error control frames of a node: its heartbeat, or the guarding poll and its answer.
    fn error_control(plan: &NodePlan) -> impl Iterator<Item = Self> {
        let control = plan.error_control;
        let lost_ms = u32::try_from(control.lost_after().as_millis()).unwrap_or(u32::MAX);
        let answer =
            Self::heartbeat(plan.node, Sender::Node(plan.node), control.period_ms(), Some(lost_ms));
        let is_guarded = matches!(control, ErrorControl::Guarding(_));
        let poll = answer.clone().filter(|_| is_guarded).map(|answer| Self {
            sender: Sender::Master,
            bytes: 0,
            deadline_us: None,
            ..answer
        });
        answer.into_iter().chain(poll)
    }

    /// PDO of a node; `None` if disabled.
    pub fn pdo(pdo: &Pdo, plan: &NodePlan, sync_period_us: u32) -> Option<Self> {
        let service = pdo.service.as_ref()?;
        let (role, sender) = match pdo.direction {
            Direction::Transmit => (Role::Tpdo(pdo.number), Sender::Node(plan.node)),
            Direction::Receive => (Role::Rpdo(pdo.number), Sender::Master),
        };
        let syncs = syncs(pdo.direction, service);
        let pace = syncs.map_or_else(
            || change(pdo.direction, service, plan, sync_period_us),
            |syncs| Pace::Clock { period_us: sync_period_us.saturating_mul(u32::from(syncs)) },
        );
        let deadline_us = match pace {
            Pace::Clock { period_us } => Some(period_us),
            Pace::Change { .. } | Pace::Chance { .. } => None,
        };
        let slot = |mapped: &MappedObject| Slot { mapped: *mapped, node: plan.node };
        Some(Self {
            cob_id: pdo.cob_id,
            role,
            sender,
            nodes: vec![plan.node],
            bytes: service.bytes(),
            pace,
            syncs,
            slots: service.mapping.iter().map(slot).collect(),
            deadline_us,
        })
    }

    /// Sporadic frame of eight bytes.
    fn sporadic(cob_id: u16, role: Role, sender: Sender, node: NodeId, gap_us: u32) -> Self {
        Self {
            cob_id,
            role,
            sender,
            nodes: vec![node],
            bytes: FULL,
            pace: Pace::Chance { gap_us },
            syncs: None,
            slots: Vec::new(),
            deadline_us: None,
        }
    }

    /// Returns whether every cycle has the frame.
    pub const fn is_cyclic(&self) -> bool {
        matches!(self.syncs, Some(1))
    }

    /// Minimum length, in bits.
    pub const fn least_bits(&self) -> u32 {
        bits::unstuffed(self.bytes)
    }

    /// Maximum length, in bits.
    pub const fn worst_bits(&self) -> u32 {
        bits::worst_case(self.bytes)
    }

    /// Merges the same frame of a further node: every drive of a group takes its own slot.
    fn join(&mut self, other: Self) {
        for (slot, theirs) in self.slots.iter_mut().zip(&other.slots) {
            if slot.mapped.object.is_dummy() {
                *slot = *theirs;
            }
        }
        self.slots.extend(other.slots.into_iter().skip(self.slots.len()));
        self.bytes = self.bytes.max(other.bytes);
        self.nodes.extend(other.nodes);
    }
}

/// Number of SYNCs between two frames of a PDO; `None` if SYNC does not govern it. Torques are sent in every
/// cycle.
fn syncs(direction: Direction, service: &Service) -> Option<u8> {
    let mut mapped = service.mapping.iter();
    let is_commanded = direction == Direction::Receive
        && mapped.any(|mapped| mapped.object == Object::TARGET_TORQUE);
    service.transmission.syncs().or(is_commanded.then_some(1))
}

/// Frequency of an event-driven PDO.
fn change(direction: Direction, service: &Service, plan: &NodePlan, sync_period_us: u32) -> Pace {
    let is_rare = service.mapping.iter().all(|mapped| RARE.contains(&mapped.object));
    let values = if is_rare { Values::Rare } else { Values::Varying };
    match direction {
        Direction::Transmit => Pace::Change {
            gap_us: inhibit_us(service).unwrap_or(sync_period_us),
            timer_us: timer_us(service),
            values,
        },
        // The timer of an RPDO is the drive's timeout, not the master's period.
        Direction::Receive => {
            Pace::Change { gap_us: answer_us(plan, sync_period_us), timer_us: None, values }
        }
    }
}

fn inhibit_us(service: &Service) -> Option<u32> {
    service.inhibit_100us.filter(|inhibit| *inhibit > 0).map(|inhibit| u32::from(inhibit) * 100)
}

fn timer_us(service: &Service) -> Option<u32> {
    service.event_timer_ms.filter(|timer| *timer > 0).map(|timer| u32::from(timer) * 1_000)
}

/// Minimum time between two controlwords: the master sends one in response to a statusword.
fn answer_us(plan: &NodePlan, sync_period_us: u32) -> u32 {
    let services = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Transmit);
    let mut services = services.filter_map(|pdo| pdo.service.as_ref());
    let status = services
        .find(|service| service.mapping.iter().any(|mapped| mapped.object == Object::STATUSWORD));
    status.and_then(inhibit_us).unwrap_or(sync_period_us).max(sync_period_us)
}

/// Planned frames of one bus by descending priority: SYNC, the master's heartbeat, and the frames of `plans`.
pub fn streams<'a>(
    plans: impl IntoIterator<Item = &'a NodePlan>,
    sync_period_us: u32,
    master: NodeId,
    master_heartbeat_ms: u16,
) -> Vec<Stream> {
    let plans: Vec<&NodePlan> = plans.into_iter().collect();
    let is_counted = plans.iter().any(|plan| setting(plan, Object::SYNC_OVERFLOW).is_some());
    let sync = Stream { bytes: u32::from(is_counted), ..Stream::sync(sync_period_us) };
    let mut streams: Vec<Stream> = vec![sync];
    let lost_ms = plans.iter().filter_map(|plan| master_lost_ms(plan)).min();
    streams.extend(Stream::heartbeat(master, Sender::Master, master_heartbeat_ms, lost_ms));
    for plan in plans {
        for stream in plan.pdos.iter().filter_map(|pdo| Stream::pdo(pdo, plan, sync_period_us)) {
            let is_shared = matches!(stream.role, Role::Rpdo(_));
            let known = streams.iter_mut().find(|known| known.cob_id == stream.cob_id);
            match known.filter(|known| is_shared && matches!(known.role, Role::Rpdo(_))) {
                Some(known) => known.join(stream),
                None => streams.push(stream),
            }
        }
        streams.extend(Stream::error_control(plan));
    }
    streams.sort_by_key(|stream| stream.cob_id);
    streams
}

/// Consumer heartbeat time of the node for its master (1016h:1), in ms.
fn master_lost_ms(plan: &NodePlan) -> Option<u32> {
    let value = setting(plan, Object::CONSUMER_HEARTBEAT)?;
    if let Value::Unsigned32(raw) = value { Some(raw & 0xFFFF) } else { None }
}

/// Planned value of an object.
fn setting(plan: &NodePlan, object: Object) -> Option<Value> {
    let mut settings = plan.safety.iter();
    settings.find(|(of, _)| *of == object).map(|(_, value)| *value)
}

/// Sporadic frames of a bus: one emergency per node every `emergency_gap_us`, one SDO exchange every
/// `sdo_gap_us` with the node of the highest priority.
pub fn sporadic<'a>(
    plans: impl IntoIterator<Item = &'a NodePlan>,
    emergency_gap_us: u32,
    sdo_gap_us: u32,
) -> Vec<Stream> {
    let plans: Vec<&NodePlan> = plans.into_iter().collect();
    let emergency = |plan: &&NodePlan| {
        let sender = Sender::Node(plan.node);
        Stream::sporadic(plan.emcy_cob_id, Role::Emergency, sender, plan.node, emergency_gap_us)
    };
    let mut streams: Vec<Stream> = plans.iter().map(emergency).collect();
    if let Some(node) = plans.iter().map(|plan| plan.node).min_by_key(|node| node.raw()) {
        let [request, response] = [SDO_REQUEST, SDO_RESPONSE].map(|id| id + u16::from(node.raw()));
        let (request_role, response_role) = (Role::SdoRequest, Role::SdoResponse);
        streams.push(Stream::sporadic(request, request_role, Sender::Master, node, sdo_gap_us));
        streams.push(Stream::sporadic(
            response,
            response_role,
            Sender::Node(node),
            node,
            sdo_gap_us,
        ));
    }
    streams.sort_by_key(|stream| stream.cob_id);
    streams
}

/// Function codes of SDO request and response (CiA 301, 7.3.5).
const SDO_REQUEST: u16 = 0x600;
const SDO_RESPONSE: u16 = 0x580;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::networks::{drives, grouped, master, node};

    #[test]
    fn shared_rpdo_is_one_frame() {
        let streams = streams(&grouped(), 1_000, master(), 5);
        let torques: Vec<_> = streams.iter().filter(|s| s.role == Role::Rpdo(1)).collect();
        assert_eq!(torques.iter().map(|s| s.cob_id).collect::<Vec<_>>(), [0x201, 0x204]);
        for (torque, first) in torques.iter().zip([1_u8, 4]) {
            assert_eq!((torque.bytes, torque.nodes.len()), (6, 3));
            let slots: Vec<_> = torque.slots.iter().map(|s| (s.mapped.object, s.node)).collect();
            let own = |place| (Object::TARGET_TORQUE, node(first + place));
            assert_eq!(slots, [own(0), own(1), own(2)]);
        }
    }

    #[test]
    fn streams_are_sorted_by_priority_without_duplicates() {
        let mut all = streams(&grouped(), 1_000, master(), 5);
        assert!(all.windows(2).all(|pair| pair[0].cob_id < pair[1].cob_id));
        all.extend(sporadic(&grouped(), 100_000, 10_000));
        all.sort_by_key(|stream| stream.cob_id);
        assert!(all.windows(2).all(|pair| pair[0].cob_id < pair[1].cob_id));
    }

    #[test]
    fn controlword_is_sent_on_change_and_torque_every_cycle() {
        let grouped = streams(&grouped(), 1_000, master(), 5);
        let of = |cob_id| grouped.iter().find(|stream| stream.cob_id == cob_id).unwrap().pace;
        let rare = Values::Rare;
        assert_eq!(of(0x301), Pace::Change { gap_us: 10_000, timer_us: None, values: rare });
        assert_eq!(of(0x201), Pace::Clock { period_us: 1_000 });
        let mut arriving = drives(1);
        for service in arriving[0].pdos.iter_mut().filter_map(|pdo| pdo.service.as_mut()) {
            service.transmission = sync::TransmissionType::EVENT_OF_PROFILE;
        }
        let arriving = streams(&arriving, 1_000, master(), 5);
        let torque = arriving.iter().find(|stream| stream.role == Role::Rpdo(1)).unwrap();
        assert_eq!(torque.pace, Pace::Clock { period_us: 1_000 });
    }

    #[test]
    fn heartbeat_deadline_is_the_rest_of_its_timeout() {
        let streams = streams(&drives(1), 1_000, master(), 5);
        let left = |cob_id| streams.iter().find(|s| s.cob_id == cob_id).unwrap().deadline_us;
        assert_eq!(left(0x77F), Some(17_000));
        assert_eq!(left(0x701), Some(35_000));
    }

    #[test]
    fn node_without_heartbeat_has_no_stream() {
        assert_eq!(Stream::heartbeat(master(), Sender::Master, 0, None), None);
    }
}
