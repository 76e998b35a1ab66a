//! Timing and arbitration of one bus: exact frame lengths, lowest identifier first.
//!
//! The node's frames wait in a FIFO queue, as in a Linux driver: only its head takes part in arbitration. The other
//! stations offer all their frames.

use std::collections::VecDeque;

use canopen::bits;
use canopen::frame::Frame;

/// Nanoseconds in a second.
const SECOND: u64 = 1_000_000_000;

/// Sender of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sender {
    /// Node under test.
    Node,
    /// Any other station.
    Station,
}

/// Frame being transmitted.
#[derive(Clone, Copy, Debug)]
struct Passing {
    sender: Sender,
    frame: Frame,
    done: u64,
}

/// State of one bus. Times are in ns, so that bit times are exact.
#[derive(Clone, Debug)]
pub(super) struct Wire {
    bit_ns: u64,
    from_node: VecDeque<Frame>,
    from_stations: Vec<Frame>,
    passing: Option<Passing>,
    idle_since: u64,
    /// Frames of the node are held, independently of their COB-IDs.
    pub(super) node_is_cut: bool,
    /// Number of frames transmitted.
    pub(super) frames: u64,
    /// Number of bits transmitted.
    pub(super) bits: u64,
}

impl Wire {
    /// Creates an idle bus of `bitrate` bit/s.
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

    /// Returns the number of frames in the node's queue.
    pub(super) fn waiting(&self) -> usize {
        self.from_node.len()
    }

    /// Empties the node's queue.
    pub(super) fn forget_node(&mut self) {
        self.from_node.clear();
    }

    /// Offers this frame whenever the bus is idle.
    pub(super) fn flood(&mut self, frame: Frame) {
        if !self.from_stations.contains(&frame) {
            self.from_stations.push(frame);
        }
    }

    /// Queues a frame; [`begin`](Self::begin) starts its transmission.
    pub(super) fn offer(&mut self, sender: Sender, frame: Frame) {
        match sender {
            Sender::Node => self.from_node.push_back(frame),
            Sender::Station => self.from_stations.push(frame),
        }
    }

    /// Returns the time at which the current transmission ends.
    pub(super) fn done(&self) -> Option<u64> {
        self.passing.map(|passing| passing.done)
    }

    /// Returns the frame that is complete at `now`. The next one has not started: its receivers may still answer with a
    /// higher priority.
    pub(super) fn complete(&mut self, now: u64) -> Option<(Sender, Frame)> {
        let passing = self.passing.take_if(|passing| passing.done <= now)?;
        self.idle_since = passing.done;
        self.frames += 1;
        Some((passing.sender, passing.frame))
    }

    /// Starts the frame with the lowest identifier if the bus is idle. Equal identifiers: the node first, then in
    /// order of arrival.
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
