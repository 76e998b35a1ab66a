//! Detection of two nodes with the same node-id, which CANopen does not provide.
//!
//! Each sign may have another reason, such as a second master. Each makes the node-id's messages
//! unreliable.

use std::time::Duration;

use canopen_rs::sdo::request_cob_id;
use canopen_rs::{NmtState, NodeId};
use derive_more::Display;

use crate::frame::Frame;
use crate::sdo::command::{CCS_DOWNLOAD, CCS_UPLOAD, SCS_DOWNLOAD, SCS_UPLOAD};
use units::time::Instant;

/// Sign of two nodes with one node-id.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Hash)]
pub enum Sign {
    /// Two boot-up messages for one reset, after two consecutive resets.
    #[display("boots up twice after one reset")]
    TwoBootUps,
    /// One SDO reply more than there were requests.
    #[display("answers one SDO request twice")]
    ExtraReply,
    /// More heartbeats than configured (1017h).
    #[display("sends more heartbeats than configured")]
    ExtraHeartbeats,
    /// Two NMT states that alternate.
    #[display("is in two NMT states by turns")]
    AlternatingStates,
}

/// Monitor of one node's heartbeats for signs of a second node.
///
/// Every heartbeat adds one period to a level that sinks by 1.5 periods per period. One node keeps it near
/// one period despite jitter, even with a clock a third too fast. Two nodes raise it by half a period per
/// pair of heartbeats.
#[derive(Clone, Copy, Debug)]
pub struct HeartbeatMonitor {
    period: Duration,
    level: Duration,
    last: Option<(Instant, NmtState)>,
    /// Consecutive heartbeats that each reported another state than the one before.
    changes: u32,
    is_reported: bool,
}

impl HeartbeatMonitor {
    /// Returns a monitor for a node that sends a heartbeat every `period`; zero if the period is unknown.
    pub const fn new(period: Duration) -> Self {
        Self { period, level: Duration::ZERO, last: None, changes: 0, is_reported: false }
    }

    /// Takes a heartbeat that reports `state`. Returns a sign once.
    pub fn on_heartbeat(&mut self, now: Instant, state: NmtState) -> Option<Sign> {
        let before = self.last.replace((now, state));
        let passed = before.map_or(Duration::ZERO, |(at, _)| now.since(at));
        self.level = self.level.saturating_sub(passed * 3 / 2) + self.period;
        let has_changed = before.is_some_and(|(_, before)| before != state);
        self.changes = if has_changed { self.changes + 1 } else { 0 };
        let sign = if self.changes >= MAX_STATE_CHANGES {
            Sign::AlternatingStates
        } else if self.level > self.period * MAX_LEVEL_PERIODS {
            Sign::ExtraHeartbeats
        } else {
            return None;
        };
        let is_news = !std::mem::replace(&mut self.is_reported, true);
        is_news.then_some(sign)
    }

    /// Starts again after a boot-up.
    pub const fn restart(&mut self) {
        *self = Self::new(self.period);
    }
}

/// Counter of one node's SDO requests and replies, for the last two objects requested. One reply more than
/// requests comes from a second node; a late reply does not.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReplyCounter {
    newest: Balance,
    before: Balance,
}

/// Kind of an SDO reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// One more than there were requests.
    OneTooMany,
    /// To an abandoned request, for the object before the newest one.
    Late,
    /// To the newest request, or to a request that is not counted.
    Other,
}

/// Requests and replies for one object.
#[derive(Clone, Copy, Debug, Default)]
struct Balance {
    /// Index, little-endian, and sub-index.
    object: [u8; 3],
    requests: u32,
    replies: u32,
}

impl ReplyCounter {
    /// Counts the sent frames that request an object from `node`.
    pub fn on_requests(&mut self, node: NodeId, sent: &[Frame]) {
        for frame in sent.iter().filter(|frame| frame.cob_id == request_cob_id(node)) {
            let &[command, low, high, sub, ..] = frame.data() else { continue };
            if !matches!(command >> 5, CCS_DOWNLOAD | CCS_UPLOAD) {
                continue;
            }
            let object = [low, high, sub];
            if self.newest.object != object {
                self.before =
                    std::mem::replace(&mut self.newest, Balance { object, ..Balance::default() });
            }
            self.newest.requests = self.newest.requests.saturating_add(1);
        }
    }

    /// Counts a reply of the node's SDO server.
    pub fn on_reply(&mut self, frame: &Frame) -> Reply {
        let &[command, low, high, sub, _, _, _, _] = frame.data() else { return Reply::Other };
        if !matches!(command >> 5, SCS_DOWNLOAD | SCS_UPLOAD) {
            return Reply::Other;
        }
        let is_about =
            |counted: &&mut Balance| counted.requests > 0 && counted.object == [low, high, sub];
        let is_late = self.newest.object != [low, high, sub];
        let Some(counted) = [&mut self.newest, &mut self.before].into_iter().find(is_about) else {
            return Reply::Other;
        };
        counted.replies = counted.replies.saturating_add(1);
        if counted.replies > counted.requests {
            Reply::OneTooMany
        } else if is_late {
            Reply::Late
        } else {
            Reply::Other
        }
    }

    /// Returns whether the server has started to answer an object but still owes replies for it.
    pub fn is_behind(&self) -> bool {
        let is_behind = |it: &Balance| it.replies > 0 && it.replies < it.requests;
        is_behind(&self.newest) || is_behind(&self.before)
    }
}

/// Maximum level in periods: heartbeats may bunch on a busy bus or after a change of state.
const MAX_LEVEL_PERIODS: u32 = 6;
/// Consecutive changes of state that no single node or master causes.
const MAX_STATE_CHANGES: u32 = 6;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIOD: Duration = Duration::from_millis(25);
    const OPERATIONAL: NmtState = NmtState::Operational;

    fn at(ms: u64) -> Instant {
        Instant::from_micros(ms * 1_000)
    }

    #[test]
    fn two_nodes_are_detected_within_fifteen_periods() {
        let mut monitor = HeartbeatMonitor::new(PERIOD);
        let beats = (0..40).flat_map(|turn| [turn * 25, turn * 25 + 7]);
        let signs: Vec<_> =
            beats.filter_map(|ms| Some((ms, monitor.on_heartbeat(at(ms), OPERATIONAL)?))).collect();
        assert_eq!(signs.len(), 1, "reported once: {signs:?}");
        let (ms, sign) = signs[0];
        assert_eq!(sign, Sign::ExtraHeartbeats);
        assert!(ms <= 15 * 25, "{ms}");
    }

    #[test]
    fn clock_a_third_too_fast_is_one_node() {
        let mut monitor = HeartbeatMonitor::new(PERIOD);
        for turn in 0..1_000 {
            assert_eq!(monitor.on_heartbeat(at(turn * 19), OPERATIONAL), None);
        }
    }

    #[test]
    fn alternating_states_are_two_nodes() {
        let mut monitor = HeartbeatMonitor::new(Duration::ZERO);
        let states = [OPERATIONAL, NmtState::PreOperational];
        let signs: Vec<_> = (0..20_u64)
            .filter_map(|turn| {
                monitor.on_heartbeat(at(turn * 25), states[usize::from(turn % 2 == 0)])
            })
            .collect();
        assert_eq!(signs, [Sign::AlternatingStates]);
    }

    #[test]
    fn started_and_stopped_node_is_one_node() {
        let mut monitor = HeartbeatMonitor::new(PERIOD);
        for turn in 0..100_u64 {
            let state = if turn / 2 % 2 == 0 { OPERATIONAL } else { NmtState::Stopped };
            assert_eq!(monitor.on_heartbeat(at(turn * 25), state), None);
        }
    }

    /// Lets `nodes` nodes with one node-id answer a read of each sub-index; returns whether that is detected.
    fn is_detected(nodes: usize, subs: &[u8]) -> bool {
        let (node, mut replies) = (NodeId::new(3).unwrap(), ReplyCounter::default());
        let mut late = Vec::new();
        let mut detected = false;
        for sub in subs {
            replies.on_requests(node, &[Frame::new(0x603, [0x40, 0x18, 0x10, *sub, 0, 0, 0, 0])]);
            let reply = Frame::new(0x583, [0x43, 0x18, 0x10, *sub, 1, 2, 3, 4]);
            // All but the first reply arrive after the next request.
            late.push(reply);
            for frame in std::mem::replace(&mut late, vec![reply; nodes - 1]) {
                detected |= replies.on_reply(&frame) == Reply::OneTooMany;
            }
        }
        detected
    }

    #[test]
    fn second_node_is_detected_by_its_replies() {
        assert!(!is_detected(1, &[1, 2, 3, 4, 4, 4, 1]));
        assert!(is_detected(2, &[1, 2]));
        assert!(is_detected(2, &[1, 1, 2]));
    }

    #[test]
    fn aborts_and_segments_are_not_counted() {
        let (node, mut replies) = (NodeId::new(3).unwrap(), ReplyCounter::default());
        replies.on_requests(node, &[Frame::new(0x603, [0x40, 0, 0x10, 0, 0, 0, 0, 0])]);
        for command in [0x80, 0x00, 0x10, 0x20, 0x30, 0xA0] {
            for _ in 0..3 {
                let frame = Frame::new(0x583, [command, 0, 0x10, 0, 0, 0, 0, 0]);
                assert_eq!(replies.on_reply(&frame), Reply::Other, "{command:02X}");
            }
        }
    }

    proptest! {
        #[test]
        fn jitter_of_one_node_is_never_two_nodes(
            jitter in proptest::collection::vec(0_u64..60, 1..200),
        ) {
            let mut monitor = HeartbeatMonitor::new(PERIOD);
            for (turn, jitter) in (0..).zip(jitter) {
                prop_assert_eq!(monitor.on_heartbeat(at(turn * 25 + jitter), OPERATIONAL), None);
            }
        }
    }
}
