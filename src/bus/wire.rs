//! One wire: frames take their exact time on it, and the lowest identifier goes first.
//!
//! The node's frames wait in a queue of their own, first in first out, as behind a Linux driver: only
//! its head takes part in arbitration. Every other station offers all it has.

use std::collections::VecDeque;

use canopen::bits;
use canopen::frame::Frame;

/// Nanoseconds in a second.
const SECOND: u64 = 1_000_000_000;

/// Who sent a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sender {
    /// The node, whose bus this is.
    Node,
    /// Anyone else.
    Station,
}

/// A frame under way.
#[derive(Clone, Copy, Debug)]
struct Passing {
    sender: Sender,
    frame: Frame,
    done: u64,
}

/// One bus's wire. Times are in ns, so that no bit rate leaves a remainder.
#[derive(Clone, Debug)]
pub(super) struct Wire {
    bit_ns: u64,
    from_node: VecDeque<Frame>,
    from_stations: Vec<Frame>,
    passing: Option<Passing>,
    idle_since: u64,
    /// The node's frames wait, whatever their identifiers.
    pub(super) node_is_cut: bool,
    /// Frames that were complete.
    pub(super) frames: u64,
    /// Bits they took.
    pub(super) bits: u64,
}

impl Wire {
    /// An idle wire of `bitrate` bit/s, with room for as many waiting frames as are usual.
    pub(super) fn new(bitrate: u32) -> Self {
        Self {
            bit_ns: SECOND / u64::from(bitrate.max(1)),
            from_node: VecDeque::with_capacity(64),
            from_stations: Vec::with_capacity(64),
            passing: None,
            idle_since: 0,
            node_is_cut: false,
            frames: 0,
            bits: 0,
        }
    }

    /// How many of the node's frames wait.
    pub(super) fn waiting(&self) -> usize {
        self.from_node.len()
    }

    /// What waits of the node's is lost.
    pub(super) fn forget_node(&mut self) {
        self.from_node.clear();
    }

    /// Somebody always wants to send this frame.
    pub(super) fn flood(&mut self, frame: Frame) {
        if !self.from_stations.contains(&frame) {
            self.from_stations.push(frame);
        }
    }

    /// A frame wants to be sent; [`begin`](Self::begin) lets it.
    pub(super) fn offer(&mut self, sender: Sender, frame: Frame) {
        match sender {
            Sender::Node => self.from_node.push_back(frame),
            Sender::Station => self.from_stations.push(frame),
        }
    }

    /// When the frame under way is complete.
    pub(super) fn done(&self) -> Option<u64> {
        self.passing.map(|passing| passing.done)
    }

    /// The frame that is complete at `now`, if one is. The next one has not begun: whoever hears this
    /// frame may still have an answer of higher priority.
    pub(super) fn complete(&mut self, now: u64) -> Option<(Sender, Frame)> {
        let passing = self.passing.take_if(|passing| passing.done <= now)?;
        self.idle_since = passing.done;
        self.frames += 1;
        Some((passing.sender, passing.frame))
    }

    /// Lets the waiting frame of the lowest identifier begin, if the wire is idle. Of equal ones the
    /// node's, then the first to come.
    pub(super) fn begin(&mut self, now: u64) {
        if self.passing.is_some() {
            return;
        }
        let of_node = self.from_node.front().filter(|_| !self.node_is_cut);
        let of_node = of_node.map(|frame| frame.cob_id);
        let waiting = self.from_stations.iter().enumerate();
        let of_stations = waiting.min_by_key(|(_, frame)| frame.cob_id);
        let of_stations = of_stations.map(|(place, frame)| (place, frame.cob_id));
        let next = match (of_node, of_stations) {
            (None, None) => return,
            (Some(node), Some((place, station))) if station < node => {
                (Sender::Station, Some(self.from_stations.remove(place)))
            }
            (None, Some((place, _))) => (Sender::Station, Some(self.from_stations.remove(place))),
            (Some(_), _) => (Sender::Node, self.from_node.pop_front()),
        };
        if let (sender, Some(frame)) = next {
            let bits = u64::from(bits::exact(&frame));
            self.bits += bits;
            let done = now.max(self.idle_since) + bits * self.bit_ns;
            self.passing = Some(Passing { sender, frame, done });
        }
    }
}
