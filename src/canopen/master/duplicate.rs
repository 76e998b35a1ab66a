//! Signs that two nodes have the same node-id, which CANopen itself has no word for.
//!
//! Each sign alone may have another reason, such as a second master; all of them are reasons not to
//! trust what that node-id says.

use std::fmt;
use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::sdo::request_cob_id;

use crate::frame::Frame;
use units::time::Instant;

/// What two nodes of one node-id look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sign {
    /// Two boot-up messages for one reset, twice in a row.
    BootsTwice,
    /// The same SDO reply again, and nobody had asked again.
    AnswersTwice,
    /// More heartbeats than were ordered.
    BeatsTooOften,
    /// One state, then another, then the first again, over and over.
    Contradicts,
}

/// As in "node 3 …".
impl fmt::Display for Sign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BootsTwice => "boots up twice after one reset",
            Self::AnswersTwice => "answers one SDO request twice",
            Self::BeatsTooOften => "sends more heartbeats than it was told to",
            Self::Contradicts => "is in two NMT states by turns",
        })
    }
}

/// Listens to the heartbeats of one node for signs of a second one.
///
/// Every heartbeat adds one period to a level that sinks by three periods in two. A single node keeps it
/// near one period, however its beats jitter and even if its clock is a third too fast, as one of coarse
/// ticks is; two nodes raise it by half a period with every pair.
#[derive(Clone, Copy, Debug)]
pub struct Rhythm {
    period: Duration,
    level: Duration,
    last: Option<(Instant, NmtState)>,
    /// Heartbeats in a row that each told another state than the one before.
    changes: u32,
    is_told: bool,
}

impl Rhythm {
    /// Of a node that was told to send a heartbeat every `period`; zero for one whose period is unknown.
    pub const fn new(period: Duration) -> Self {
        Self { period, level: Duration::ZERO, last: None, changes: 0, is_told: false }
    }

    /// A heartbeat that tells `state`. A sign is given once.
    pub fn beat(&mut self, now: Instant, state: NmtState) -> Option<Sign> {
        let before = self.last.replace((now, state));
        let passed = before.map_or(Duration::ZERO, |(at, _)| now.since(at));
        self.level = self.level.saturating_sub(passed * 3 / 2) + self.period;
        let has_changed = before.is_some_and(|(_, before)| before != state);
        self.changes = if has_changed { self.changes + 1 } else { 0 };
        let sign = if self.changes >= CHANGES {
            Sign::Contradicts
        } else if self.level > self.period * BEATS {
            Sign::BeatsTooOften
        } else {
            return None;
        };
        let is_news = !std::mem::replace(&mut self.is_told, true);
        is_news.then_some(sign)
    }

    /// The node has booted up: what it said before does not count.
    pub const fn restart(&mut self) {
        *self = Self::new(self.period);
    }
}

/// Counts the requests and replies of one node for the two objects asked for last: a reply more than
/// there were requests is of a second node. Late replies to requests that were given up are none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Exchange {
    newest: Asked,
    before: Asked,
}

/// What a reply is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// One more than there were requests.
    OneTooMany,
    /// To a request that was given up, for the object before the newest one.
    Late,
    /// To the newest request, or of no request that is counted.
    Other,
}

/// What was asked for, and how often, and how often it was answered.
#[derive(Clone, Copy, Debug, Default)]
struct Asked {
    /// Index, little-endian, and sub-index.
    object: [u8; 3],
    requests: u32,
    replies: u32,
}

impl Exchange {
    /// Of these frames, those that ask `node` for an object.
    pub fn asked(&mut self, node: NodeId, sent: &[Frame]) {
        for frame in sent.iter().filter(|frame| frame.cob_id == request_cob_id(node)) {
            let &[command, low, high, sub, ..] = frame.data() else { continue };
            if !matches!(command >> 5, CCS_DOWNLOAD | CCS_UPLOAD) {
                continue;
            }
            let object = [low, high, sub];
            if self.newest.object != object {
                self.before =
                    std::mem::replace(&mut self.newest, Asked { object, ..Asked::default() });
            }
            self.newest.requests = self.newest.requests.saturating_add(1);
        }
    }

    /// Takes a frame of the node's SDO server.
    pub fn take(&mut self, frame: &Frame) -> Reply {
        let &[command, low, high, sub, _, _, _, _] = frame.data() else { return Reply::Other };
        if !matches!(command >> 5, SCS_DOWNLOAD | SCS_UPLOAD) {
            return Reply::Other;
        }
        let is_about = |asked: &&mut Asked| asked.requests > 0 && asked.object == [low, high, sub];
        let is_late = self.newest.object != [low, high, sub];
        let Some(asked) = [&mut self.newest, &mut self.before].into_iter().find(is_about) else {
            return Reply::Other;
        };
        asked.replies = asked.replies.saturating_add(1);
        if asked.replies > asked.requests {
            Reply::OneTooMany
        } else if is_late {
            Reply::Late
        } else {
            Reply::Other
        }
    }

    /// Returns whether an object was answered at last, and requests for it are still to be answered.
    pub fn is_behind(&self) -> bool {
        let is_behind = |asked: &Asked| asked.replies > 0 && asked.replies < asked.requests;
        is_behind(&self.newest) || is_behind(&self.before)
    }
}

/// The three highest bits of the frames that open a transfer, of the client and of the server.
const CCS_DOWNLOAD: u8 = 1;
const CCS_UPLOAD: u8 = 2;
const SCS_DOWNLOAD: u8 = 3;
const SCS_UPLOAD: u8 = 2;

/// So many beats may come at once, where a bus was busy or a state has changed.
const BEATS: u32 = 6;
/// So many changes of state in a row are no node's and no master's.
const CHANGES: u32 = 6;

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
    fn two_nodes_of_one_period_are_heard_within_fifteen_periods() {
        let mut rhythm = Rhythm::new(PERIOD);
        let beats = (0..40).flat_map(|turn| [turn * 25, turn * 25 + 7]);
        let signs: Vec<_> =
            beats.filter_map(|ms| Some((ms, rhythm.beat(at(ms), OPERATIONAL)?))).collect();
        assert_eq!(signs.len(), 1, "told once: {signs:?}");
        let (ms, sign) = signs[0];
        assert_eq!(sign, Sign::BeatsTooOften);
        assert!(ms <= 15 * 25, "{ms}");
    }

    #[test]
    fn a_clock_that_is_a_third_too_fast_is_one_clock() {
        let mut rhythm = Rhythm::new(PERIOD);
        for turn in 0..1_000 {
            assert_eq!(rhythm.beat(at(turn * 19), OPERATIONAL), None);
        }
    }

    #[test]
    fn two_states_by_turns_are_two_nodes() {
        let mut rhythm = Rhythm::new(Duration::ZERO);
        let states = [OPERATIONAL, NmtState::PreOperational];
        let signs: Vec<_> = (0..20_u64)
            .filter_map(|turn| rhythm.beat(at(turn * 25), states[usize::from(turn % 2 == 0)]))
            .collect();
        assert_eq!(signs, [Sign::Contradicts]);
    }

    #[test]
    fn a_node_that_is_started_and_stopped_is_one_node() {
        let mut rhythm = Rhythm::new(PERIOD);
        for turn in 0..100_u64 {
            let state = if turn / 2 % 2 == 0 { OPERATIONAL } else { NmtState::Stopped };
            assert_eq!(rhythm.beat(at(turn * 25), state), None);
        }
    }

    /// So many nodes of one node-id answer a read of each of these objects.
    fn is_noticed(nodes: usize, subs: &[u8]) -> bool {
        let (node, mut exchange) = (NodeId::new(3).unwrap(), Exchange::default());
        let mut late = Vec::new();
        let mut noticed = false;
        for sub in subs {
            exchange.asked(node, &[Frame::new(0x603, [0x40, 0x18, 0x10, *sub, 0, 0, 0, 0])]);
            let reply = Frame::new(0x583, [0x43, 0x18, 0x10, *sub, 1, 2, 3, 4]);
            // All but the first reply come when the next request is out.
            late.push(reply);
            for frame in std::mem::replace(&mut late, vec![reply; nodes - 1]) {
                noticed |= exchange.take(&frame) == Reply::OneTooMany;
            }
        }
        noticed
    }

    #[test]
    fn a_second_node_is_noticed_by_its_replies() {
        assert!(!is_noticed(1, &[1, 2, 3, 4, 4, 4, 1]));
        assert!(is_noticed(2, &[1, 2]));
        assert!(is_noticed(2, &[1, 1, 2]));
    }

    #[test]
    fn aborts_and_segments_are_no_replies() {
        let (node, mut exchange) = (NodeId::new(3).unwrap(), Exchange::default());
        exchange.asked(node, &[Frame::new(0x603, [0x40, 0, 0x10, 0, 0, 0, 0, 0])]);
        for command in [0x80, 0x00, 0x10, 0x20, 0x30, 0xA0] {
            for _ in 0..3 {
                let frame = Frame::new(0x583, [command, 0, 0x10, 0, 0, 0, 0, 0]);
                assert_eq!(exchange.take(&frame), Reply::Other, "{command:02X}");
            }
        }
    }

    proptest! {
        #[test]
        fn one_node_is_never_taken_for_two_however_its_beats_jitter(
            jitter in proptest::collection::vec(0_u64..60, 1..200),
        ) {
            let mut rhythm = Rhythm::new(PERIOD);
            for (turn, jitter) in (0..).zip(jitter) {
                prop_assert_eq!(rhythm.beat(at(turn * 25 + jitter), OPERATIONAL), None);
            }
        }
    }
}
