//! Detection of missing or late frames: SYNCs, synchronous PDOs, heartbeats.
//!
//! A synchronous PDO or a heartbeat is expected after its first reception, unless its node was stopped.

use std::time::Duration;

use canopen_rs::{NmtCommand, NmtState};

use crate::signals::PdoFrame;
use canopen::nmt::Order;
use units::time::Instant;

/// Configured timing of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// SYNC period.
    pub period: Duration,
    /// Maximum delay of a synchronous TPDO after its SYNC.
    pub window: Duration,
    /// Node-id of the master.
    pub master: u8,
    /// Consumer heartbeat time for the master.
    pub master_lost: Duration,
}

/// Remark on missing or late frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remark {
    /// Number of periods since the last SYNC.
    SyncGap(u32),
    /// PDO missing after the last SYNC: its index in the list of frames.
    Missing(usize),
    /// Delay of a synchronous TPDO after its SYNC.
    Late(Duration),
    /// Node, and time since its last heartbeat.
    Silent(u8, Duration),
    /// Mapped length of a PDO whose length differs.
    Length(usize),
}

/// Change between two heartbeats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Boot-up message: state 0.
    BootUp,
    /// First heartbeat.
    First,
    /// Another state than in the last heartbeat, which had this one.
    From(NmtState),
    /// Return after a loss of this duration.
    Back(Duration),
}

/// Time between two SYNCs, and its deviation from the period in µs.
pub(super) type Beat = (Duration, Option<i64>);

/// SYNC, heartbeats and RPDOs of one bus, compared with their periods.
#[derive(Clone, Debug)]
pub(super) struct BusMonitor {
    timing: Option<Timing>,
    sync: Option<Instant>,
    /// SYNC period, configured or measured.
    period: Option<Duration>,
    pdos: Vec<ExpectedPdo>,
    nodes: Vec<Node>,
    /// Earliest deadline of a heartbeat.
    due: Option<Instant>,
    /// Remarks on the newest frame.
    pub(super) remarks: Vec<Remark>,
}

/// Expected synchronous PDO, with its frames counted in SYNCs.
#[derive(Clone, Debug)]
struct ExpectedPdo {
    frame: usize,
    /// Number of SYNCs per frame.
    syncs: u8,
    /// Nodes that must be operational for it.
    nodes: Vec<u8>,
    has_come: bool,
    /// SYNCs since the last frame; `None` before the first one.
    age: Option<u8>,
}

/// Error control of one node-id.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    lost_after: Option<Duration>,
    last_heartbeat: Option<(Instant, NmtState)>,
    is_lost: bool,
    is_stopped: bool,
}

impl BusMonitor {
    /// Returns a monitor of the PDOs at `places` of `frames`; `node` returns the node of a member, `lost_after` its
    /// consumer heartbeat time.
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
            Some(ExpectedPdo { frame: *place, syncs, nodes, has_come: false, age: None })
        };
        let pdos = places.iter().filter_map(awaited).collect();
        let period = timing.map(|timing| timing.period);
        Self { timing, sync: None, period, pdos, nodes, due: None, remarks: Vec::new() }
    }

    /// Takes a SYNC; returns the time since the last one and remarks missing PDOs.
    pub(super) fn on_sync(&mut self, now: Option<Instant>) -> Option<Beat> {
        for pdo in &mut self.pdos {
            let is_stopped =
                |id: &u8| self.nodes.get(usize::from(*id)).is_some_and(|n| n.is_stopped);
            pdo.age = match (pdo.has_come, pdo.age) {
                _ if pdo.nodes.iter().any(is_stopped) => None,
                (true, _) => Some(0),
                (false, age) => age.map(|age| age.saturating_add(1)),
            };
            if pdo.age.is_some_and(|age| age >= pdo.syncs) {
                self.remarks.push(Remark::Missing(pdo.frame));
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
            self.remarks.push(Remark::SyncGap(u32::try_from(periods).unwrap_or(u32::MAX)));
        } else if self.timing.is_none() {
            self.period = Some((period * 7 + apart) / 8);
        }
        let more = signed_micros(apart).saturating_sub(signed_micros(period));
        Some((apart, Some(more)))
    }

    /// Takes a PDO of the layout.
    pub(super) fn on_pdo(&mut self, now: Option<Instant>, frame: usize, is_sent_by_node: bool) {
        let Some(pdo) = self.pdos.iter_mut().find(|pdo| pdo.frame == frame) else { return };
        pdo.has_come = true;
        let (Some(timing), Some(now), Some(sync)) = (self.timing, now, self.sync) else { return };
        let after = now.since(sync);
        if is_sent_by_node && after > timing.window {
            self.remarks.push(Remark::Late(after));
        }
    }

    /// Takes a heartbeat or boot-up message.
    pub(super) fn on_heartbeat(
        &mut self,
        now: Option<Instant>,
        id: u8,
        state: NmtState,
    ) -> Option<Change> {
        let node = self.nodes.get_mut(usize::from(id))?;
        node.is_stopped = state != NmtState::Operational;
        let before = node.last_heartbeat;
        let was_lost = std::mem::take(&mut node.is_lost);
        let now = now.unwrap_or_default();
        node.last_heartbeat = Some((now, state));
        if let Some(lost_after) = node.lost_after {
            let due = now + lost_after;
            self.due = Some(self.due.map_or(due, |first| first.min(due)));
        }
        match before {
            _ if state == NmtState::Initialising => Some(Change::BootUp),
            None => Some(Change::First),
            Some((last, _)) if was_lost => Some(Change::Back(now.since(last))),
            Some((_, before)) if before != state => Some(Change::From(before)),
            Some(_) => None,
        }
    }

    /// Takes an NMT command: frames of a stopped node are no longer expected.
    pub(super) fn on_order(&mut self, order: Order) {
        let is_stopped = order.command != NmtCommand::StartRemoteNode;
        for (id, node) in (0..).zip(&mut self.nodes) {
            if order.node.is_none_or(|to| to.raw() == id) {
                node.is_stopped = is_stopped;
            }
        }
    }

    /// Remarks each overdue heartbeat once.
    pub(super) fn on_time(&mut self, now: Instant) {
        if self.due.is_none_or(|due| now < due) {
            return;
        }
        self.due = None;
        for (id, node) in (0..).zip(&mut self.nodes) {
            let (Some(lost_after), Some((last, _)), false) =
                (node.lost_after, node.last_heartbeat, node.is_lost)
            else {
                continue;
            };
            let due = last + lost_after;
            if now >= due {
                node.is_lost = true;
                node.is_stopped = true;
                self.remarks.push(Remark::Silent(id, now.since(last)));
            } else {
                self.due = Some(self.due.map_or(due, |first| first.min(due)));
            }
        }
    }
}

fn signed_micros(span: Duration) -> i64 {
    i64::try_from(span.as_micros()).unwrap_or(i64::MAX)
}
