//! Decoder of bus traffic: every frame to text, with names and SI values, as for candump lines.
//!
//! A tolerant listener with bounded memory; it sends nothing. With members it uses their layout; without, the
//! predefined connection set.
//!
//! ```
//! use canopen_tools::decode::Decoder;
//!
//! let mut decoder = Decoder::generic();
//! let bus = decoder.listen(None);
//! let annotation = decoder.on_frame(bus, None, 0x703, &[0]);
//! assert_eq!((annotation.name().to_string(), annotation.to_string()), ("heartbeat node 3".into(), "boot-up".into()));
//! ```

pub mod bus_monitor;
pub mod error_frame;
pub mod lss;
mod network;
pub mod sdo;
pub mod text;

#[cfg(test)]
mod tests;

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::time::TimeOfDay;

use crate::decode::bus_monitor::{BusMonitor, Change, Remark, Timing};
use crate::decode::lss::Lss;
use crate::decode::network::{Network, Use};
use crate::decode::sdo::{Listener, Side, Step};
use crate::signals::{self, Member, PdoFrame};
use canopen::emcy::Emergency;
use canopen::frame::{Channel, Frame};
use canopen::layout::Direction;
use canopen::nmt::Order;
use canopen::sync::Sync;
use units::time::Instant;

/// Maximum number of buses; further ones share the last.
const MAX_BUSES: usize = 32;

/// Decoder of the frames of several buses.
#[derive(Clone, Debug)]
pub struct Decoder {
    members: Vec<Member>,
    frames: Vec<PdoFrame>,
    timing: Option<Timing>,
    /// Networks of the members' buses, and one for unknown buses.
    networks: Vec<Network>,
    buses: Vec<BusState>,
}

/// Index of a bus, from [`Decoder::listen`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bus(usize);

/// Network index, frame monitor and SDO transfers of one bus.
#[derive(Clone, Debug)]
struct BusState {
    network: usize,
    monitor: BusMonitor,
    sdo: Vec<Listener>,
}

/// Node by its name or number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who<'d> {
    /// Name of a configured node.
    Named(&'d str),
    /// Node-id that no configured node has.
    Node(u8),
}

/// CANopen message of a frame, decoded.
#[derive(Clone, Debug)]
pub enum Message<'d> {
    /// NMT command.
    Nmt(Order),
    /// SYNC, with the time since the last one.
    Sync {
        /// Counter, if present.
        counter: Option<u8>,
        /// Time since the last SYNC.
        period: Option<Duration>,
        /// Deviation from the period, in µs.
        jitter_us: Option<i64>,
    },
    /// TIME message: days since 1984-01-01 and ms after midnight.
    Time(TimeOfDay),
    /// EMCY message.
    Emergency(Emergency),
    /// PDO of the layout, with its zero-padded data and length.
    Pdo(&'d PdoFrame, [u8; 8], usize),
    /// PDO outside the layout: direction and number.
    OtherPdo(Direction, u8),
    /// Step of an SDO transfer.
    Sdo(Step<'d>),
    /// NMT state in a heartbeat; `None` without a change since the last one.
    Heartbeat(NmtState, Option<Change>),
    /// LSS message.
    Lss(Lss),
    /// Invalid length or content, with the expected one.
    Malformed(&'static str),
    /// COB-ID outside the layout and the predefined connection set.
    Unknown,
}

/// Annotation of a frame. `Display` is its content; [`name`](Self::name) its kind and node.
#[derive(Clone, Debug)]
pub struct Annotation<'d> {
    /// Node that sends the frame, or receives it.
    pub who: Option<Who<'d>>,
    /// Meaning of identifier and data.
    pub message: Message<'d>,
    remarks: &'d [Remark],
    decoder: &'d Decoder,
    network: usize,
    /// Index of its member.
    member: Option<usize>,
}

impl Decoder {
    /// Returns a decoder for buses with known nodes and timing.
    pub fn new(members: Vec<Member>, timing: Timing) -> Self {
        Self::with_timing(members, Some(timing))
    }

    /// Returns a decoder for a bus without a configuration.
    pub fn generic() -> Self {
        Self::with_timing(Vec::new(), None)
    }

    fn with_timing(members: Vec<Member>, timing: Option<Timing>) -> Self {
        let frames = signals::frames(&members);
        let last = members.iter().map(|member| member.channel).max();
        let channels = (0..=u8::MAX).map(Channel).take_while(|channel| last >= Some(*channel));
        let mut networks: Vec<_> = channels
            .map(|here| Network::new(&members, &frames, |channel| channel == here))
            .collect();
        networks.push(Network::new(&members, &frames, |_| true));
        Self { members, frames, timing, networks, buses: Vec::new() }
    }

    /// Adds a bus: one of the members', or an unknown one.
    pub fn listen(&mut self, channel: Option<Channel>) -> Bus {
        if self.buses.len() >= MAX_BUSES {
            return Bus(MAX_BUSES - 1);
        }
        let unnamed = self.networks.len().saturating_sub(1);
        let network = channel.map_or(unnamed, |Channel(place)| usize::from(place).min(unnamed));
        let node = |member: usize| self.members.get(member).map_or(0, |member| member.node().raw());
        let Some(layout) = self.networks.get(network) else { return Bus(MAX_BUSES) };
        let members = (0..128).filter_map(|node| self.members.get(layout.member(node)?));
        let lost_after =
            members.map(|member| (member.node().raw(), member.plan.error_control.lost_after()));
        let monitor = BusMonitor::new(self.timing, &self.frames, &layout.frames, node, lost_after);
        self.buses.push(BusState { network, monitor, sdo: vec![Listener::default(); 128] });
        Bus(self.buses.len() - 1)
    }

    /// Known nodes.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// PDOs of the layout.
    pub fn frames(&self) -> &[PdoFrame] {
        &self.frames
    }

    /// Decodes one data frame of a bus, with its time stamp if there is one.
    pub fn on_frame(
        &mut self,
        bus: Bus,
        at: Option<Instant>,
        cob_id: u16,
        data: &[u8],
    ) -> Annotation<'_> {
        let Bus(place) = bus;
        let network = self.buses.get(place).map_or(usize::MAX, |bus| bus.network);
        let use_of = self.networks.get(network).map_or(Use::Unknown, |n| n.use_of(cob_id));
        let decoded = match (Frame::from_slice(cob_id, data), self.buses.get_mut(place)) {
            (Some(frame), Some(bus)) => bus.decoded(at, use_of, &frame, &self.frames),
            (None, _) | (_, None) => OwnedMessage::Whole(Message::Malformed("at most eight bytes")),
        };
        let node = use_of.node();
        let member = if let Use::Pdo(pdo) = use_of {
            self.frames.get(pdo).and_then(author)
        } else {
            node.and_then(|node| self.networks.get(network)?.member(node))
        };
        let named = member.and_then(|member| self.members.get(member));
        let who = match (named, node) {
            (Some(member), _) => Some(Who::Named(&member.name)),
            (None, node) => node.map(|node| self.who(network, node)),
        };
        let message = self.message(place, decoded);
        let remarks = self.buses.get(place).map(|bus| &*bus.monitor.remarks).unwrap_or_default();
        Annotation { who, message, member, network, remarks, decoder: self }
    }

    /// Adds the borrowed parts of a decoded frame.
    fn message(&self, place: usize, decoded: OwnedMessage) -> Message<'_> {
        match decoded {
            OwnedMessage::Pdo(pdo, data, length) => match self.frames.get(pdo) {
                Some(frame) => Message::Pdo(frame, data, length),
                None => Message::Unknown,
            },
            OwnedMessage::Sdo(node, side, kind) => {
                let bus = self.buses.get(place);
                match bus.and_then(|bus| bus.sdo.get(usize::from(node))) {
                    Some(listener) => Message::Sdo(listener.step(side, kind)),
                    None => Message::Unknown,
                }
            }
            OwnedMessage::Whole(message) => message,
        }
    }

    fn who(&self, network: usize, node: u8) -> Who<'_> {
        let member = self.networks.get(network).and_then(|network| network.member(node));
        match member.and_then(|member| self.members.get(member)) {
            Some(member) => Who::Named(&member.name),
            None if self.timing.is_some_and(|timing| timing.master == node) => Who::Named("master"),
            None => Who::Node(node),
        }
    }
}

impl BusState {
    /// Decodes one frame, without borrowed parts.
    fn decoded(
        &mut self,
        at: Option<Instant>,
        use_of: Use,
        frame: &Frame,
        frames: &[PdoFrame],
    ) -> OwnedMessage {
        self.monitor.remarks.clear();
        if let Some(now) = at {
            self.monitor.on_time(now);
        }
        let eight = <[u8; 8]>::try_from(frame.data()).ok();
        let whole = match (use_of, eight) {
            (Use::Pdo(pdo), _) => return self.on_pdo(at, pdo, frame, frames),
            (Use::Sdo(side, node), Some(data)) => return self.on_sdo(node, side, data),
            (Use::Lss(side), Some(data)) => {
                Some(Message::Lss(Lss { is_request: side == Side::Client, data }))
            }
            (Use::Sdo(..) | Use::Lss(_), None) => None,
            (Use::Nmt, _) => Order::decode(frame).map(|order| {
                self.monitor.on_order(order);
                Message::Nmt(order)
            }),
            (Use::Sync, _) => Sync::decode(frame).map(|Sync { counter }| {
                let (period, jitter_us) = self.monitor.on_sync(at).unzip();
                Message::Sync { counter, period, jitter_us: jitter_us.flatten() }
            }),
            (Use::Time, _) => TimeOfDay::decode(frame.data()).ok().map(Message::Time),
            (Use::Emergency(_), _) => Emergency::decode(frame.data()).map(Message::Emergency),
            (Use::OtherPdo(direction, number, _), _) => Some(Message::OtherPdo(direction, number)),
            (Use::Heartbeat(node), _) => {
                let state =
                    frame.data().try_into().ok().and_then(|byte| decode_heartbeat(byte).ok());
                state.map(|state| {
                    Message::Heartbeat(state, self.monitor.on_heartbeat(at, node, state))
                })
            }
            (Use::Unknown, _) => Some(Message::Unknown),
        };
        OwnedMessage::Whole(whole.unwrap_or_else(|| Message::Malformed(use_of.expects())))
    }

    fn on_pdo(
        &mut self,
        at: Option<Instant>,
        pdo: usize,
        frame: &Frame,
        frames: &[PdoFrame],
    ) -> OwnedMessage {
        let Some(layout) = frames.get(pdo) else { return OwnedMessage::Whole(Message::Unknown) };
        let length = frame.data().len();
        if length != layout.bytes {
            self.monitor.remarks.push(Remark::Length(layout.bytes));
        }
        self.monitor.on_pdo(at, pdo, !layout.senders.is_empty());
        let mut data = [0; 8];
        for (to, from) in data.iter_mut().zip(frame.data()) {
            *to = *from;
        }
        OwnedMessage::Pdo(pdo, data, length)
    }

    fn on_sdo(&mut self, node: u8, side: Side, data: [u8; 8]) -> OwnedMessage {
        match self.sdo.get_mut(usize::from(node)) {
            Some(listener) => OwnedMessage::Sdo(node, side, listener.on_frame(side, data)),
            None => OwnedMessage::Whole(Message::Unknown),
        }
    }
}

/// [`Message`] without borrowed parts.
#[derive(Clone, Debug)]
enum OwnedMessage {
    /// Index of the PDO, its data and length.
    Pdo(usize, [u8; 8], usize),
    /// Node, side and step of a transfer.
    Sdo(u8, Side, sdo::ActionKind),
    /// Borrows nothing.
    Whole(Message<'static>),
}

/// Returns the member of a PDO: its sender, or else its receiver; `None` for several.
fn author(frame: &PdoFrame) -> Option<usize> {
    let authors = if frame.senders.is_empty() { &frame.receivers } else { &frame.senders };
    match authors.as_slice() {
        [one] => Some(*one),
        _ => None,
    }
}
