//! Heartbeats (CiA 301, 7.2.8.3.2): producer of the master's heartbeat, consumer of each node's.
//!
//! The cycle polls the [`Producer`] behind its RPDOs, unless it has stalled. So the heartbeat stops with the cycle, and the
//! drives react (1016h). The [`Consumer`] only reports.
//!
//! One byte: the NMT state, or 0 as the boot-up message.

use std::time::Duration;

use canopen_rs::nmt::{decode_heartbeat, encode_heartbeat, heartbeat_cob_id};
use canopen_rs::{NmtState, NodeId};

use crate::frame::Frame;
use crate::master::duplicate::{HeartbeatMonitor, Sign};
use units::time::Instant;

/// Returns whether the frame is the boot-up message of `node`.
pub fn is_boot_up(frame: &Frame, node: NodeId) -> bool {
    frame.cob_id == heartbeat_cob_id(node) && frame.data() == [0]
}

/// Returns whether the frame reports the state of `node`: a heartbeat, a boot-up message, or the answer to guarding.
pub fn reports_state(frame: &Frame, node: NodeId) -> bool {
    frame.cob_id == heartbeat_cob_id(node) && !frame.is_remote()
}

/// Heartbeat producer of a node, here the master.
#[derive(Clone, Debug)]
pub struct Producer {
    /// Reported state.
    pub state: NmtState,
    node: NodeId,
    period: Duration,
    next: Instant,
}

impl Producer {
    /// Returns a producer whose first heartbeat is due at once, then every `period`.
    pub const fn new(node: NodeId, period: Duration, state: NmtState) -> Self {
        Self { state, node, period, next: Instant::ZERO }
    }

    /// Returns a heartbeat now; the next is due one period later.
    pub fn beat(&mut self, now: Instant) -> Frame {
        self.next = now + self.period;
        Frame::new(heartbeat_cob_id(self.node), encode_heartbeat(self.state))
    }

    /// Returns the heartbeat if one is due. After a delay of a period or more, the period restarts at `now`.
    pub fn due(&mut self, now: Instant) -> Option<Frame> {
        if now < self.next {
            return None;
        }
        let on_beat = self.next + self.period;
        self.next = if on_beat > now { on_beat } else { now + self.period };
        Some(Frame::new(heartbeat_cob_id(self.node), encode_heartbeat(self.state)))
    }
}

/// NMT state of a node, if known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// No heartbeat received yet, within the time allowed.
    NeverSeen,
    /// Last reported state, within the heartbeat time.
    Alive(NmtState),
    /// No heartbeat within the time allowed, at the start or since.
    Lost,
}

impl Health {
    /// Returns the event of a boot-up message from a node with this health before.
    pub(crate) const fn on_boot_up(self) -> HeartbeatEvent {
        match self {
            Self::NeverSeen => HeartbeatEvent::BootedUp,
            Self::Alive(_) | Self::Lost => HeartbeatEvent::Rebooted,
        }
    }
}

/// Change of a node's health.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeartbeatEvent {
    /// First state, another state than the last, or any state after a loss.
    State(NmtState),
    /// Boot-up message before any heartbeat or loss.
    BootedUp,
    /// Boot-up message after a heartbeat, a boot-up message or a loss: the configuration is lost.
    Rebooted,
    /// Heartbeat lost. Reported once.
    Lost,
    /// Sign of two nodes with this node-id. Reported once per boot-up, instead of a state change.
    Duplicate(Sign),
}

/// Heartbeat consumer for one node.
#[derive(Clone, Debug)]
pub struct Consumer {
    node: NodeId,
    timeout: Duration,
    health: Health,
    due: Instant,
    monitor: HeartbeatMonitor,
}

impl Consumer {
    /// Returns a consumer that allows `timeout` between heartbeats, and until `first` for the first one.
    pub const fn new(node: NodeId, timeout: Duration, first: Instant) -> Self {
        let monitor = HeartbeatMonitor::new(Duration::ZERO);
        Self { node, timeout, health: Health::NeverSeen, due: first, monitor }
    }

    /// Sets the producer heartbeat time of the node, to detect a second node.
    #[must_use]
    pub const fn every(self, period: Duration) -> Self {
        Self { monitor: HeartbeatMonitor::new(period), ..self }
    }

    /// NMT state of the node, if known.
    pub const fn health(&self) -> Health {
        self.health
    }

    /// Returns whether the heartbeat is overdue, even before [`on_time`](Self::on_time) is called.
    pub fn is_lost(&self, now: Instant) -> bool {
        self.health == Health::Lost || now >= self.due
    }

    /// Takes one frame.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<HeartbeatEvent> {
        if frame.cob_id != heartbeat_cob_id(self.node) {
            return None;
        }
        let state = decode_heartbeat(frame.data().try_into().ok()?).ok()?;
        let before = self.health;
        self.due = now + self.timeout;
        if state == NmtState::Initialising {
            self.health = Health::Alive(NmtState::PreOperational);
            self.monitor.restart();
            return Some(before.on_boot_up());
        }
        self.health = Health::Alive(state);
        if let Some(sign) = self.monitor.on_heartbeat(now, state) {
            return Some(HeartbeatEvent::Duplicate(sign));
        }
        (before != self.health).then_some(HeartbeatEvent::State(state))
    }

    /// Reports an overdue heartbeat once.
    pub fn on_time(&mut self, now: Instant) -> Option<HeartbeatEvent> {
        if self.health == Health::Lost || now < self.due {
            return None;
        }
        self.health = Health::Lost;
        Some(HeartbeatEvent::Lost)
    }

    /// Time at which the heartbeat is overdue.
    pub fn deadline(&self) -> Option<Instant> {
        (self.health != Health::Lost).then_some(self.due)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn at(ms: u64) -> Instant {
        Instant::from_micros(ms * 1_000)
    }

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn consumer() -> Consumer {
        Consumer::new(node(), 60 * MS, at(500))
    }

    fn beat(state: u8) -> Frame {
        Frame::new(0x703, [state])
    }

    #[test]
    fn heartbeat_is_sent_once_per_period() {
        let mut producer = Producer::new(NodeId::new(127).unwrap(), 5 * MS, NmtState::Operational);
        let beats: Vec<u64> = (0..20).filter(|ms| producer.due(at(*ms)).is_some()).collect();
        assert_eq!(beats, [0, 5, 10, 15]);
        assert_eq!(producer.due(at(20)), Some(Frame::new(0x77F, [0x05])));
    }

    #[test]
    fn missed_heartbeats_are_skipped() {
        let mut producer = Producer::new(NodeId::new(127).unwrap(), 5 * MS, NmtState::Operational);
        let beats: Vec<u64> =
            [0, 33, 34, 35, 38].into_iter().filter(|ms| producer.due(at(*ms)).is_some()).collect();
        assert_eq!(beats, [0, 33, 38]);
    }

    #[test]
    fn absent_node_is_lost_at_the_start_deadline() {
        let mut watch = consumer();
        assert_eq!(watch.on_time(at(499)), None);
        assert!(!watch.is_lost(at(499)));
        assert!(watch.is_lost(at(500)));
        assert_eq!(watch.on_time(at(500)), Some(HeartbeatEvent::Lost));
        assert_eq!(watch.on_time(at(501)), None, "reported once");
        assert_eq!(watch.deadline(), None);
    }

    #[test]
    fn node_is_lost_one_timeout_after_its_last_heartbeat() {
        let mut watch = consumer();
        assert_eq!(
            watch.on_frame(at(100), &beat(5)),
            Some(HeartbeatEvent::State(NmtState::Operational))
        );
        assert_eq!(watch.on_frame(at(125), &beat(5)), None);
        assert_eq!(watch.deadline(), Some(at(185)));
        assert!(!watch.is_lost(at(184)));
        assert_eq!(watch.on_time(at(185)), Some(HeartbeatEvent::Lost));
        assert_eq!(watch.health(), Health::Lost);
    }

    #[test]
    fn boot_up_of_a_known_node_is_a_reboot() {
        let mut watch = consumer();
        assert_eq!(watch.on_frame(at(1), &beat(0)), Some(HeartbeatEvent::BootedUp));
        assert_eq!(watch.on_frame(at(2), &beat(0x7F)), None, "a booted node is pre-operational");
        assert_eq!(watch.on_frame(at(3), &beat(0)), Some(HeartbeatEvent::Rebooted));
        assert_eq!(watch.on_time(at(100)), Some(HeartbeatEvent::Lost));
        assert_eq!(watch.on_frame(at(101), &beat(0)), Some(HeartbeatEvent::Rebooted));
    }

    #[test]
    fn twice_the_heartbeats_are_of_two_nodes() {
        let mut watch = consumer().every(25 * MS);
        let beats = (0..20).flat_map(|turn| [turn * 25, turn * 25 + 3]);
        let news: Vec<_> = beats.filter_map(|ms| watch.on_frame(at(ms), &beat(5))).collect();
        let first = HeartbeatEvent::State(NmtState::Operational);
        assert_eq!(news, [first, HeartbeatEvent::Duplicate(Sign::ExtraHeartbeats)]);
    }

    #[test]
    fn only_heartbeats_of_the_node_keep_it_alive() {
        let mut watch = consumer();
        for frame in [
            Frame::new(0x704, [5]),
            Frame::new(0x703, []),
            Frame::new(0x703, [5, 5]),
            Frame::new(0x703, [0x42]),
        ] {
            assert_eq!(watch.on_frame(at(499), &frame), None, "{frame}");
        }
        assert!(watch.is_lost(at(500)));
    }

    proptest! {
        #[test]
        fn lost_nodes_exceeded_the_timeout(
            steps in proptest::collection::vec((0_u64..100, prop_oneof![Just(5), any::<u8>()], any::<bool>()), 0..100),
        ) {
            let mut watch = consumer();
            let (mut now, mut last) = (0, None);
            for (step, byte, speaks) in steps {
                now += step;
                if speaks {
                    watch.on_frame(at(now), &beat(byte));
                    let is_state = [0x00, 0x04, 0x05, 0x7F].contains(&(byte & 0x7F));
                    last = if is_state { Some(now) } else { last };
                }
                let due = last.map_or(500, |last| last + 60);
                prop_assert_eq!(watch.is_lost(at(now)), now >= due);
            }
        }
    }
}
