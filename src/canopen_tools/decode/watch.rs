//! What of a bus is missing or late: SYNCs, PDOs that belong to them, heartbeats.
//!
//! A listener cannot know what it has not heard begin: a synchronous PDO is waited for once it has come,
//! a heartbeat once it has been heard, and neither from a node that was stopped.

use std::time::Duration;

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;

use crate::signals::PdoFrame;
use canopen::nmt::Order;
use units::time::Instant;

/// What a bus is expected to keep, where a configuration says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// From SYNC to SYNC.
    pub period: Duration,
    /// How long after its SYNC a synchronous TPDO may come.
    pub window: Duration,
    /// Node-id of the master's heartbeat.
    pub master: u8,
    /// The master without a heartbeat for so long is lost.
    pub master_lost: Duration,
}

/// Something that is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remark {
    /// The time since the last SYNC is so many periods or more.
    SyncGap(u32),
    /// A PDO did not come with the last SYNC: its place in the list of frames.
    Missing(usize),
    /// A synchronous TPDO came so long after its SYNC.
    Late(Duration),
    /// A node's heartbeat has been silent for so long.
    Silent(u8, Duration),
    /// A PDO has other than the mapped bytes: those mapped.
    Length(usize),
}

/// What a heartbeat says that the one before did not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The node has started anew.
    BootUp,
    /// The first that was heard of it.
    First,
    /// The node has changed from this state.
    From(NmtState),
    /// It had been lost, for so long.
    Back(Duration),
}

/// The time between two SYNCs, and how much more that is than it should be, in µs.
pub(super) type Beat = (Duration, Option<i64>);

/// The watch over one bus.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    timing: Option<Timing>,
    sync: Option<Instant>,
    /// The time between SYNCs, as configured or else as it was so far.
    period: Option<Duration>,
    pdos: Vec<Awaited>,
    nodes: Vec<Node>,
    /// The first heartbeat that is due.
    due: Option<Instant>,
}

/// A synchronous PDO.
#[derive(Clone, Debug)]
struct Awaited {
    frame: usize,
    /// It comes with every so many SYNCs.
    syncs: u8,
    /// Those who must be operational for it.
    nodes: Vec<u8>,
    has_come: bool,
    /// SYNCs since it came; `None` before it ever has.
    age: Option<u8>,
}

/// One node.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    lost_after: Option<Duration>,
    heard: Option<(Instant, NmtState)>,
    is_lost: bool,
    is_stopped: bool,
}

impl Watch {
    /// Over the PDOs at `places` of `frames`, whose nodes are told by `node`; `lost_after` is said of nodes.
    pub(super) fn new(
        timing: Option<Timing>,
        frames: &[PdoFrame],
        places: &[usize],
        node: impl Fn(usize) -> u8,
        lost_after: impl IntoIterator<Item = (u8, Duration)>,
    ) -> Self {
        let mut nodes = vec![Node::default(); 128];
        let master = timing.map(|timing| (timing.master, timing.master_lost));
        for (id, lost_after) in lost_after.into_iter().chain(master) {
            if let Some(node) = nodes.get_mut(usize::from(id)) {
                node.lost_after = Some(lost_after);
            }
        }
        let awaited = |place: &usize| {
            let frame = frames.get(*place)?;
            let syncs = frame.transmission.syncs().filter(|_| frame.transmission.0 != 0)?;
            let of = if frame.senders.is_empty() { &frame.receivers } else { &frame.senders };
            let nodes = of.iter().map(|member| node(*member)).collect();
            Some(Awaited { frame: *place, syncs, nodes, has_come: false, age: None })
        };
        let pdos = places.iter().filter_map(awaited).collect();
        let period = timing.map(|timing| timing.period);
        Self { timing, sync: None, period, pdos, nodes, due: None }
    }

    /// A SYNC: the time since the last one; what has not come since then is remarked.
    pub(super) fn on_sync(
        &mut self,
        now: Option<Instant>,
        remarks: &mut Vec<Remark>,
    ) -> Option<Beat> {
        for pdo in &mut self.pdos {
            let is_stopped =
                |id: &u8| self.nodes.get(usize::from(*id)).is_some_and(|n| n.is_stopped);
            pdo.age = match (pdo.has_come, pdo.age) {
                _ if pdo.nodes.iter().any(is_stopped) => None,
                (true, _) => Some(0),
                (false, age) => age.map(|age| age.saturating_add(1)),
            };
            if pdo.age.is_some_and(|age| age >= pdo.syncs) {
                remarks.push(Remark::Missing(pdo.frame));
                pdo.age = Some(0);
            }
            pdo.has_come = false;
        }
        let before = self.sync;
        self.sync = now;
        let apart = now?.since(before?);
        let Some(period) = self.period.filter(|period| !period.is_zero()) else {
            self.period = Some(apart);
            return Some((apart, None));
        };
        if apart * 2 > period * 3 {
            let periods = apart.as_micros() / period.as_micros().max(1);
            remarks.push(Remark::SyncGap(u32::try_from(periods).unwrap_or(u32::MAX)));
        } else if self.timing.is_none() {
            self.period = Some((period * 7 + apart) / 8);
        }
        let more = signed_micros(apart).saturating_sub(signed_micros(period));
        Some((apart, Some(more)))
    }

    /// A PDO of the layout.
    pub(super) fn on_pdo(
        &mut self,
        now: Option<Instant>,
        frame: usize,
        is_sent_by_node: bool,
        remarks: &mut Vec<Remark>,
    ) {
        let Some(pdo) = self.pdos.iter_mut().find(|pdo| pdo.frame == frame) else { return };
        pdo.has_come = true;
        let (Some(timing), Some(now), Some(sync)) = (self.timing, now, self.sync) else { return };
        let after = now.since(sync);
        if is_sent_by_node && after > timing.window {
            remarks.push(Remark::Late(after));
        }
    }

    /// A heartbeat or boot-up message.
    pub(super) fn on_heartbeat(
        &mut self,
        now: Option<Instant>,
        id: u8,
        state: NmtState,
    ) -> Option<Change> {
        let node = self.nodes.get_mut(usize::from(id))?;
        node.is_stopped = state != NmtState::Operational;
        let before = node.heard;
        let was_lost = std::mem::take(&mut node.is_lost);
        let now = now.unwrap_or_default();
        node.heard = Some((now, state));
        if let Some(lost_after) = node.lost_after {
            let due = now + lost_after;
            self.due = Some(self.due.map_or(due, |first| first.min(due)));
        }
        match before {
            _ if state == NmtState::Initialising => Some(Change::BootUp),
            None => Some(Change::First),
            Some((heard, _)) if was_lost => Some(Change::Back(now.since(heard))),
            Some((_, before)) if before != state => Some(Change::From(before)),
            Some(_) => None,
        }
    }

    /// A command of the NMT master: what it stops is no longer waited for.
    pub(super) fn on_order(&mut self, order: Order) {
        let is_stopped = order.command != NmtCommand::StartRemoteNode;
        for (id, node) in (0..).zip(&mut self.nodes) {
            if order.node.is_none_or(|to| to.raw() == id) {
                node.is_stopped = is_stopped;
            }
        }
    }

    /// Remarks whose heartbeat has not come in time, once.
    pub(super) fn on_time(&mut self, now: Instant, remarks: &mut Vec<Remark>) {
        if self.due.is_none_or(|due| now < due) {
            return;
        }
        self.due = None;
        for (id, node) in (0..).zip(&mut self.nodes) {
            let (Some(lost_after), Some((heard, _)), false) =
                (node.lost_after, node.heard, node.is_lost)
            else {
                continue;
            };
            let due = heard + lost_after;
            if now >= due {
                node.is_lost = true;
                node.is_stopped = true;
                remarks.push(Remark::Silent(id, now.since(heard)));
            } else {
                self.due = Some(self.due.map_or(due, |first| first.min(due)));
            }
        }
    }
}

fn signed_micros(span: Duration) -> i64 {
    i64::try_from(span.as_micros()).unwrap_or(i64::MAX)
}
