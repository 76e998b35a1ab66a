//! Heartbeats (CiA 301, 7.2.8.3.2): the master's own, and the watch over each node's.
//!
//! The [`Producer`] sends nothing by itself: the cycle asks it after its own checks have passed, so a
//! dead cycle is a silent one and the drives stop (1016h). The [`Consumer`] says what it hears; what
//! follows from that is decided elsewhere.
//!
//! One byte: the NMT state, or 0 once as the boot-up message.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::nmt::encode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;

use crate::frame::Frame;
use crate::master::duplicate::Rhythm;
use crate::master::duplicate::Sign;
use units::time::Instant;

/// Whether the frame is the boot-up message of `node`.
pub fn is_boot_up(frame: &Frame, node: NodeId) -> bool {
    frame.cob_id == heartbeat_cob_id(node) && frame.data() == [0]
}

/// The heartbeat of a node, here the master.
#[derive(Clone, Debug)]
pub struct Producer {
    /// The state it reports.
    pub state: NmtState,
    node: NodeId,
    period: Duration,
    next: Instant,
}

impl Producer {
    /// One that is due at once, then every `period`.
    pub const fn new(node: NodeId, period: Duration, state: NmtState) -> Self {
        Self { state, node, period, next: Instant::ZERO }
    }

    /// A heartbeat now, whether one is due or not; the next is due a period later.
    pub fn beat(&mut self, now: Instant) -> Frame {
        self.next = now + self.period;
        Frame::new(heartbeat_cob_id(self.node), encode_heartbeat(self.state))
    }

    /// The heartbeat, if one is due. Missed ones are not made up for.
    pub fn due(&mut self, now: Instant) -> Option<Frame> {
        if now < self.next {
            return None;
        }
        let on_beat = self.next + self.period;
        self.next = if on_beat > now { on_beat } else { now + self.period };
        Some(Frame::new(heartbeat_cob_id(self.node), encode_heartbeat(self.state)))
    }
}

/// What is known of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// Nothing was heard yet, and need not have been.
    NeverSeen,
    /// It said so in time.
    Alive(NmtState),
    /// It was silent for too long, from the start or since.
    Lost,
}

/// What has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum News {
    /// A state other than the last, or the first one heard.
    State(NmtState),
    /// A boot-up message, and nothing before it.
    BootedUp,
    /// A boot-up message of a node that had been heard: whatever was set in it is gone.
    Rebooted,
    /// Silent for too long. Said once.
    Lost,
    /// It sounds as if there were two. Said once.
    Duplicate(Sign),
}

/// The watch over one node.
#[derive(Clone, Debug)]
pub struct Consumer {
    node: NodeId,
    timeout: Duration,
    health: Health,
    due: Instant,
    rhythm: Rhythm,
}

impl Consumer {
    /// A watch that allows `timeout` between heartbeats, and until `first` for the first one.
    pub const fn new(node: NodeId, timeout: Duration, first: Instant) -> Self {
        let rhythm = Rhythm::new(Duration::ZERO);
        Self { node, timeout, health: Health::NeverSeen, due: first, rhythm }
    }

    /// The same, knowing how often the node was told to send one: twice as many are of two nodes.
    #[must_use]
    pub const fn every(self, period: Duration) -> Self {
        Self { rhythm: Rhythm::new(period), ..self }
    }

    /// What is known of the node.
    pub const fn health(&self) -> Health {
        self.health
    }

    /// Whether it has been silent for too long, [`on_time`](Self::on_time) called or not.
    pub fn is_lost(&self, now: Instant) -> bool {
        self.health == Health::Lost || now >= self.due
    }

    /// Listens to one frame.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<News> {
        if frame.cob_id != heartbeat_cob_id(self.node) {
            return None;
        }
        let state = decode_heartbeat(frame.data().try_into().ok()?).ok()?;
        let before = self.health;
        self.due = now + self.timeout;
        if state == NmtState::Initialising {
            self.health = Health::Alive(NmtState::PreOperational);
            self.rhythm.restart();
            let news = if before == Health::NeverSeen { News::BootedUp } else { News::Rebooted };
            return Some(news);
        }
        self.health = Health::Alive(state);
        if let Some(sign) = self.rhythm.beat(now, state) {
            return Some(News::Duplicate(sign));
        }
        (before != self.health).then_some(News::State(state))
    }

    /// Says once when the node has been silent for too long.
    pub fn on_time(&mut self, now: Instant) -> Option<News> {
        if self.health == Health::Lost || now < self.due {
            return None;
        }
        self.health = Health::Lost;
        Some(News::Lost)
    }

    /// When the node will have been silent for too long.
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
    fn the_master_beats_once_a_period_however_often_it_is_asked() {
        let mut producer = Producer::new(NodeId::new(127).unwrap(), 5 * MS, NmtState::Operational);
        let beats: Vec<u64> = (0..20).filter(|ms| producer.due(at(*ms)).is_some()).collect();
        assert_eq!(beats, [0, 5, 10, 15]);
        assert_eq!(producer.due(at(20)), Some(Frame::new(0x77F, [0x05])));
    }

    #[test]
    fn missed_beats_are_not_made_up_for() {
        let mut producer = Producer::new(NodeId::new(127).unwrap(), 5 * MS, NmtState::Operational);
        let beats: Vec<u64> =
            [0, 33, 34, 35, 38].into_iter().filter(|ms| producer.due(at(*ms)).is_some()).collect();
        assert_eq!(beats, [0, 33, 38]);
    }

    #[test]
    fn a_node_never_seen_is_lost_at_the_start_deadline_and_not_before() {
        let mut watch = consumer();
        assert_eq!(watch.on_time(at(499)), None);
        assert!(!watch.is_lost(at(499)));
        assert!(watch.is_lost(at(500)));
        assert_eq!(watch.on_time(at(500)), Some(News::Lost));
        assert_eq!(watch.on_time(at(501)), None, "said once");
        assert_eq!(watch.deadline(), None);
    }

    #[test]
    fn a_node_that_falls_silent_is_lost_one_timeout_after_its_last_word() {
        let mut watch = consumer();
        assert_eq!(watch.on_frame(at(100), &beat(5)), Some(News::State(NmtState::Operational)));
        assert_eq!(watch.on_frame(at(125), &beat(5)), None);
        assert_eq!(watch.deadline(), Some(at(185)));
        assert!(!watch.is_lost(at(184)));
        assert_eq!(watch.on_time(at(185)), Some(News::Lost));
        assert_eq!(watch.health(), Health::Lost);
    }

    #[test]
    fn a_boot_up_of_a_living_node_is_a_reboot() {
        let mut watch = consumer();
        assert_eq!(watch.on_frame(at(1), &beat(0)), Some(News::BootedUp));
        assert_eq!(watch.on_frame(at(2), &beat(0x7F)), None, "a booted node is pre-operational");
        assert_eq!(watch.on_frame(at(3), &beat(0)), Some(News::Rebooted));
        assert_eq!(watch.on_time(at(100)), Some(News::Lost));
        assert_eq!(watch.on_frame(at(101), &beat(0)), Some(News::Rebooted));
    }

    #[test]
    fn twice_the_heartbeats_are_of_two_nodes() {
        let mut watch = consumer().every(25 * MS);
        let beats = (0..20).flat_map(|turn| [turn * 25, turn * 25 + 3]);
        let news: Vec<_> = beats.filter_map(|ms| watch.on_frame(at(ms), &beat(5))).collect();
        let first = News::State(NmtState::Operational);
        assert_eq!(news, [first, News::Duplicate(Sign::BeatsTooOften)]);
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
        fn what_is_lost_has_been_silent_for_the_timeout(
            steps in proptest::collection::vec((0_u64..100, prop_oneof![Just(5), any::<u8>()], any::<bool>()), 0..100),
        ) {
            let mut watch = consumer();
            let (mut now, mut heard) = (0, None);
            for (step, byte, speaks) in steps {
                now += step;
                if speaks {
                    watch.on_frame(at(now), &beat(byte));
                    let is_state = [0x00, 0x04, 0x05, 0x7F].contains(&(byte & 0x7F));
                    heard = if is_state { Some(now) } else { heard };
                }
                let due = heard.map_or(500, |heard| heard + 60);
                prop_assert_eq!(watch.is_lost(at(now)), now >= due);
            }
        }
    }
}
