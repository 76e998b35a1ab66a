//! Last heartbeat of each node of a bus, and the interval of its heartbeats.

use std::time::Duration;

use canopen_rs::nmt::{decode_heartbeat, heartbeat_cob_id};
use canopen_rs::{NmtState, NodeId};

use canopen::frame::Frame;
use units::time::Instant;

/// Missing heartbeats in a row after which a node counts as silent.
const MAX_MISSED: u32 = 3;

/// Heartbeat or boot-up message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beat {
    pub node: NodeId,
    /// NMT state; [`NmtState::Initialising`] for a boot-up.
    pub state: NmtState,
    /// Time of reception.
    pub at: Instant,
    /// Time since the heartbeat before it; `None` for the first one and after a boot-up.
    pub interval: Option<Duration>,
}

impl Beat {
    /// Returns whether the next ones are overdue at `now`, as far as their interval is known.
    pub fn is_overdue(&self, now: Instant) -> bool {
        self.interval.is_some_and(|interval| now.since(self.at) > interval * MAX_MISSED)
    }
}

/// Last heartbeat of each node.
#[derive(Clone, Debug, Default)]
pub struct Beats(Vec<Beat>);

impl Beats {
    /// Takes one frame; returns its heartbeat if it is one.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<Beat> {
        let state = frame.data().try_into().ok().and_then(|data| decode_heartbeat(data).ok())?;
        let [_, low] = frame.cob_id.to_be_bytes();
        let node = NodeId::new(low & 0x7F).ok()?;
        if frame.cob_id != heartbeat_cob_id(node) || frame.is_remote() {
            return None;
        }
        let known = self.0.iter_mut().find(|beat| beat.node == node);
        let is_next = |last: &&mut Beat| {
            last.state != NmtState::Initialising && state != NmtState::Initialising
        };
        let interval = known.as_ref().filter(|last| is_next(last)).map(|last| now.since(last.at));
        let beat = Beat { node, state, at: now, interval };
        match known {
            Some(last) => *last = beat,
            None => self.0.push(beat),
        }
        Some(beat)
    }

    /// Returns the last heartbeat of a node.
    pub fn last(&self, node: NodeId) -> Option<Beat> {
        self.0.iter().find(|beat| beat.node == node).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Instant {
        Instant::from_micros(ms * 1_000)
    }

    #[test]
    fn heartbeats_are_overdue_after_three_intervals() {
        let mut beats = Beats::default();
        let node = NodeId::new(3).unwrap();
        for (ms, state) in [(10, 0), (20, 0x7F)] {
            beats.on_frame(at(ms), &Frame::new(0x703, [state]));
            let beat = beats.last(node).unwrap();
            assert_eq!(beat.interval, None);
            assert!(!beat.is_overdue(at(10_000)), "the interval is not known");
        }
        beats.on_frame(at(120), &Frame::new(0x703, [5]));
        let beat = beats.last(node).unwrap();
        assert_eq!((beat.state, beat.at), (NmtState::Operational, at(120)));
        assert_eq!(beat.interval, Some(Duration::from_millis(100)));
        assert!(!beat.is_overdue(at(420)) && beat.is_overdue(at(421)));
    }

    #[test]
    fn other_frames_are_no_heartbeats() {
        let mut beats = Beats::default();
        for frame in [
            Frame::new(0x703, []),
            Frame::new(0x703, [5, 5]),
            Frame::new(0x700, [5]),
            Frame::remote(0x703, 1),
        ] {
            assert_eq!(beats.on_frame(at(1), &frame), None, "{frame}");
        }
    }
}
