//! Distances of the SYNCs of one bus: I10.
//!
//! The node sends at most half a period late, and does not repeat a missed SYNC. So two SYNCs that the bus accepts are at
//! least half a period apart. The wire, or a disturbed adapter, may delay one until just before the next: the node is
//! then judged by the times of acceptance alone.

use std::time::Duration;

use canopen::bits;
use canopen::frame::Frame;
use units::time::Instant;

/// Number of SYNCs that are remembered.
const REMEMBERED: usize = 10;

/// Maximum error of a frame's start: the times of two frames are rounded to 1 µs.
const ROUNDING: Duration = Duration::from_micros(2);

/// SYNCs of one bus: times of acceptance, and times on the wire.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spacing {
    bit_ns: u64,
    accepted: Times,
    sent: Times,
    /// Set if the newest SYNC waited for other frames only.
    was_held_by_wire: bool,
    /// Start of the frames that follow each other without a gap, and the end of the last one.
    busy: [Instant; 2],
}

/// SYNCs that are too close: number, and time from the first to the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Burst {
    pub(super) syncs: u32,
    pub(super) within: Duration,
}

/// Times of the last SYNCs, the newest last.
#[derive(Clone, Copy, Debug, Default)]
struct Times([Option<Instant>; REMEMBERED]);

impl Spacing {
    /// Creates the record of a silent bus of `bitrate` bit/s.
    pub(super) fn new(bitrate: u32) -> Self {
        Self {
            bit_ns: 1_000_000_000 / u64::from(bitrate.max(1)),
            accepted: Times::default(),
            sent: Times::default(),
            was_held_by_wire: false,
            busy: [Instant::ZERO; 2],
        }
    }

    /// Returns the time of the last SYNC on the wire.
    pub(super) fn latest(&self) -> Option<Instant> {
        self.sent.latest()
    }

    /// Returns the time at which the bus accepted the last SYNC.
    pub(super) fn latest_accepted(&self) -> Option<Instant> {
        self.accepted.latest()
    }

    /// Takes a SYNC that the bus accepts; returns the burst that it ends. One may be half a period late.
    pub(super) fn on_accepted(&mut self, period: Duration, at: Instant) -> Option<Burst> {
        let is_burst = |Burst { syncs, within }: &Burst| match syncs {
            ..=2 => *within < period / 2,
            syncs => *within <= period * (syncs - 2),
        };
        let burst = self.accepted.bursts(at).find(is_burst);
        self.accepted.push(at);
        burst
    }

    /// Takes the end of any frame on the wire.
    pub(super) fn on_frame(&mut self, at: Instant, frame: &Frame) {
        let start = at - Duration::from_nanos(u64::from(bits::exact(frame)) * self.bit_ns);
        let [first, end] = &mut self.busy;
        if start > *end + ROUNDING {
            *first = start;
        }
        *end = at;
    }

    /// Takes a SYNC on the wire that was accepted at `since`, after [`on_frame`](Self::on_frame); returns the burst that
    /// it ends. Two may be a quarter of a period apart, for six late targets of zero that precede the first. They may be
    /// closer if the first waited for a busy wire, or the adapter `is_disturbed`, and the second was handed over after
    /// the first had left.
    pub(super) fn on_sync(
        &mut self,
        period: Duration,
        [since, at]: [Instant; 2],
        is_disturbed: bool,
    ) -> Option<Burst> {
        let was_held = self.was_held_by_wire || is_disturbed;
        let is_excused = was_held && self.latest().is_some_and(|left| left < since);
        let is_burst = |Burst { syncs, within }: &Burst| match syncs {
            ..=2 => !is_excused && *within <= period / 4,
            syncs => *within <= period * (syncs - 2),
        };
        let burst = self.sent.bursts(at).find(is_burst);
        self.sent.push(at);
        let [busy_since, _] = self.busy;
        self.was_held_by_wire = busy_since <= since + ROUNDING;
        burst
    }
}

impl Times {
    fn latest(&self) -> Option<Instant> {
        self.0.last().copied().flatten()
    }

    /// Returns the SYNCs that end at `at`: the last two, the last three, and so on.
    fn bursts(&self, at: Instant) -> impl Iterator<Item = Burst> {
        let before = self.0.iter().rev().map_while(|before| *before);
        (2..).zip(before).map(move |(syncs, before)| Burst { syncs, within: at.since(before) })
    }

    fn push(&mut self, at: Instant) {
        self.0.rotate_left(1);
        self.0.iter_mut().last().into_iter().for_each(|last| *last = Some(at));
    }
}
