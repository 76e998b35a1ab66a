//! A bus in words: every frame to what it says, by name and SI value, as candump lines are read.
//!
//! A listener, not a participant: it sends nothing, forgives everything, and its memory is bounded
//! whatever it hears. With members it reads their layout; without, the predefined connection set.
//!
//! ```
//! use canopen_tools::decode::Decoder;
//!
//! let mut decoder = Decoder::generic();
//! let bus = decoder.listen(None);
//! let said = decoder.on_frame(bus, None, 0x703, &[0]);
//! assert_eq!((said.name().to_string(), said.to_string()), ("heartbeat node 3".into(), "boot-up".into()));
//! ```

pub mod error_frame;
pub mod lss;
mod network;
pub mod sdo;
pub mod text;
pub mod watch;

#[cfg(test)]
mod tests;

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::time::TimeOfDay;

use crate::decode::lss::Lss;
use crate::decode::network::Network;
use crate::decode::network::Use;
use crate::decode::sdo::Listener;
use crate::decode::sdo::Side;
use crate::decode::sdo::Step;
use crate::decode::watch::Beat;
use crate::decode::watch::Change;
use crate::decode::watch::Remark;
use crate::decode::watch::Timing;
use crate::decode::watch::Watch;
use crate::signals;
use crate::signals::Member;
use crate::signals::PdoFrame;
use canopen::emcy::Emergency;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::layout::Direction;
use canopen::nmt::Order;
use canopen::sync::Sync;
use units::time::Instant;

/// More buses than this are heard as one.
const MOST_BUSES: usize = 32;

/// Reads the frames of some buses.
#[derive(Clone, Debug)]
pub struct Decoder {
    members: Vec<Member>,
    frames: Vec<PdoFrame>,
    timing: Option<Timing>,
    /// One for each bus of the members, and one for a bus nobody has named.
    networks: Vec<Network>,
    buses: Vec<Heard>,
    remarks: Vec<Remark>,
}

/// A bus that is listened to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bus(usize);

/// What was heard of one bus.
#[derive(Clone, Debug)]
struct Heard {
    network: usize,
    watch: Watch,
    sdo: Vec<Listener>,
}

/// A node by its name, or else by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who<'d> {
    /// It is in the configuration.
    Named(&'d str),
    /// It is not.
    Node(u8),
}

/// What a frame says.
#[derive(Clone, Debug)]
pub enum What<'d> {
    /// A command of the NMT master.
    Nmt(Order),
    /// SYNC, and when the last one was.
    Sync {
        /// Its counter, if it has one.
        counter: Option<u8>,
        /// The time since the last one.
        period: Option<Duration>,
        /// How much more that is than it should be, in µs.
        jitter_us: Option<i64>,
    },
    /// The time of day.
    Time(TimeOfDay),
    /// An emergency.
    Emergency(Emergency),
    /// A PDO of the layout, with its data, zeros where it has less, and its length.
    Pdo(&'d PdoFrame, [u8; 8], usize),
    /// A PDO that is in no layout: whose, its direction and number.
    OtherPdo(Direction, u8),
    /// A part of an SDO transfer.
    Sdo(Step<'d>),
    /// A heartbeat, and what is new in it.
    Heartbeat(NmtState, Option<Change>),
    /// A layer setting service.
    Lss(Lss),
    /// What should be there has another length or an unknown content: what it should be.
    Malformed(&'static str),
    /// Nobody knows.
    Unknown,
}

/// A frame in words. Its `Display` is what it says; [`name`](Self::name) is what it is.
#[derive(Clone, Debug)]
pub struct Annotation<'d> {
    /// Whose frame it is: who sends it, or for whom it is.
    pub who: Option<Who<'d>>,
    /// What it says.
    pub what: What<'d>,
    remarks: &'d [Remark],
    decoder: &'d Decoder,
    network: usize,
    /// The member it is about, if there is one.
    member: Option<usize>,
}

impl Decoder {
    /// Of buses whose nodes are known, and of their timing.
    pub fn new(members: Vec<Member>, timing: Timing) -> Self {
        Self::of(members, Some(timing))
    }

    /// Of a bus of which nothing is known.
    pub fn generic() -> Self {
        Self::of(Vec::new(), None)
    }

    fn of(members: Vec<Member>, timing: Option<Timing>) -> Self {
        let frames = signals::frames(&members);
        let last = members.iter().map(|member| member.channel).max();
        let channels = (0..=u8::MAX).map(Channel).take_while(|channel| last >= Some(*channel));
        let mut networks: Vec<_> = channels
            .map(|here| Network::new(&members, &frames, |channel| channel == here))
            .collect();
        networks.push(Network::new(&members, &frames, |_| true));
        Self { members, frames, timing, networks, buses: Vec::new(), remarks: Vec::new() }
    }

    /// A further bus: one of the members', or one that nobody has named.
    pub fn listen(&mut self, channel: Option<Channel>) -> Bus {
        if self.buses.len() >= MOST_BUSES {
            return Bus(MOST_BUSES - 1);
        }
        let unnamed = self.networks.len().saturating_sub(1);
        let network = channel.map_or(unnamed, |Channel(place)| usize::from(place).min(unnamed));
        let node = |member: usize| self.members.get(member).map_or(0, |member| member.node().raw());
        let Some(layout) = self.networks.get(network) else { return Bus(MOST_BUSES) };
        let members = (0..128).filter_map(|node| self.members.get(layout.member(node)?));
        let lost_after =
            members.map(|member| (member.node().raw(), member.plan.error_control.lost_after()));
        let watch = Watch::new(self.timing, &self.frames, &layout.frames, node, lost_after);
        self.buses.push(Heard { network, watch, sdo: vec![Listener::default(); 128] });
        Bus(self.buses.len() - 1)
    }

    /// Every node that is known.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// Every PDO of the layout.
    pub fn frames(&self) -> &[PdoFrame] {
        &self.frames
    }

    /// Takes one data frame of a bus, with its stamp if it has one, and says what it is.
    pub fn on_frame(
        &mut self,
        bus: Bus,
        at: Option<Instant>,
        cob_id: u16,
        data: &[u8],
    ) -> Annotation<'_> {
        self.remarks.clear();
        let Bus(place) = bus;
        let network = self.buses.get(place).map_or(usize::MAX, |heard| heard.network);
        let use_of = self.networks.get(network).map_or(Use::Unknown, |n| n.use_of(cob_id));
        let told = match (Frame::from_slice(cob_id, data), self.buses.get_mut(place)) {
            (Some(frame), Some(heard)) => {
                heard.told(at, use_of, &frame, &self.frames, &mut self.remarks)
            }
            (None, _) | (_, None) => Told::Malformed("at most eight bytes"),
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
        let what = self.what(place, told);
        Annotation { who, what, member, network, remarks: &self.remarks, decoder: self }
    }

    /// With everything it borrows.
    fn what(&self, place: usize, told: Told) -> What<'_> {
        match told {
            Told::Pdo(pdo, data, length) => match self.frames.get(pdo) {
                Some(frame) => What::Pdo(frame, data, length),
                None => What::Unknown,
            },
            Told::Sdo(node, side, what) => {
                let heard = self.buses.get(place);
                match heard.and_then(|heard| heard.sdo.get(usize::from(node))) {
                    Some(listener) => What::Sdo(listener.step(side, what)),
                    None => What::Unknown,
                }
            }
            Told::Sync(sync, beat) => What::Sync {
                counter: sync.counter,
                period: beat.map(|(period, _)| period),
                jitter_us: beat.and_then(|(_, jitter)| jitter),
            },
            Told::Nmt(order) => What::Nmt(order),
            Told::Time(time) => What::Time(time),
            Told::Emergency(emergency) => What::Emergency(emergency),
            Told::OtherPdo(direction, number) => What::OtherPdo(direction, number),
            Told::Heartbeat(state, change) => What::Heartbeat(state, change),
            Told::Lss(lss) => What::Lss(lss),
            Told::Malformed(expected) => What::Malformed(expected),
            Told::Unknown => What::Unknown,
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

impl Heard {
    /// What one frame says, before anything is borrowed.
    fn told(
        &mut self,
        at: Option<Instant>,
        use_of: Use,
        frame: &Frame,
        frames: &[PdoFrame],
        remarks: &mut Vec<Remark>,
    ) -> Told {
        if let Some(now) = at {
            self.watch.on_time(now, remarks);
        }
        let eight = <[u8; 8]>::try_from(frame.data()).ok();
        let told = match use_of {
            Use::Nmt => Order::decode(frame).map(|order| {
                self.watch.on_order(order);
                Told::Nmt(order)
            }),
            Use::Sync => {
                Sync::decode(frame).map(|sync| Told::Sync(sync, self.watch.on_sync(at, remarks)))
            }
            Use::Time => TimeOfDay::decode(frame.data()).ok().map(Told::Time),
            Use::Emergency(_) => Emergency::decode(frame.data()).map(Told::Emergency),
            Use::Pdo(pdo) => Some(self.on_pdo(at, pdo, frame, frames, remarks)),
            Use::OtherPdo(direction, number, _) => Some(Told::OtherPdo(direction, number)),
            Use::SdoRequest(node) => eight.map(|data| self.on_sdo(node, Side::Client, data)),
            Use::SdoResponse(node) => eight.map(|data| self.on_sdo(node, Side::Server, data)),
            Use::Heartbeat(node) => {
                let state =
                    frame.data().try_into().ok().and_then(|byte| decode_heartbeat(byte).ok());
                state.map(|state| Told::Heartbeat(state, self.watch.on_heartbeat(at, node, state)))
            }
            Use::LssRequest => eight.map(|data| Told::Lss(Lss { is_request: true, data })),
            Use::LssResponse => eight.map(|data| Told::Lss(Lss { is_request: false, data })),
            Use::Unknown => Some(Told::Unknown),
        };
        told.unwrap_or_else(|| Told::Malformed(use_of.expects()))
    }

    fn on_pdo(
        &mut self,
        at: Option<Instant>,
        pdo: usize,
        frame: &Frame,
        frames: &[PdoFrame],
        remarks: &mut Vec<Remark>,
    ) -> Told {
        let Some(layout) = frames.get(pdo) else { return Told::Unknown };
        let length = frame.data().len();
        if length != layout.bytes {
            remarks.push(Remark::Length(layout.bytes));
        }
        self.watch.on_pdo(at, pdo, !layout.senders.is_empty(), remarks);
        let mut data = [0; 8];
        for (to, from) in data.iter_mut().zip(frame.data()) {
            *to = *from;
        }
        Told::Pdo(pdo, data, length)
    }

    fn on_sdo(&mut self, node: u8, side: Side, data: [u8; 8]) -> Told {
        match self.sdo.get_mut(usize::from(node)) {
            Some(listener) => Told::Sdo(node, side, listener.on_frame(side, data)),
            None => Told::Unknown,
        }
    }
}

/// [`What`] before anything is borrowed.
#[derive(Clone, Copy, Debug)]
enum Told {
    Nmt(Order),
    Sync(Sync, Option<Beat>),
    Time(TimeOfDay),
    Emergency(Emergency),
    Pdo(usize, [u8; 8], usize),
    OtherPdo(Direction, u8),
    Sdo(u8, Side, sdo::What),
    Heartbeat(NmtState, Option<Change>),
    Lss(Lss),
    Malformed(&'static str),
    Unknown,
}

/// The one node a PDO is about: who sends it, or else who takes it; `None` if there are several.
fn author(frame: &PdoFrame) -> Option<usize> {
    let authors = if frame.senders.is_empty() { &frame.receivers } else { &frame.senders };
    match authors.as_slice() {
        [one] => Some(*one),
        _ => None,
    }
}
