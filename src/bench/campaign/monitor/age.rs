//! Age of the node's frames, from acceptance by the bus until they are on the wire, or act.
//!
//! An adapter may delay frames, and the node cannot recall them. The node is therefore judged by the time of acceptance; the
//! drives report whether an old target acted.

use std::collections::VecDeque;
use std::time::Duration;

use crate::monitor::sheet::Sheet;
use canopen::frame::{Channel, Frame, Telegram};
use units::numbering::Joint;
use units::time::Instant;

/// Maximum age of a target that is not stale, in periods: 2 ms at 1 kHz.
const MAX_AGE: u32 = 2;

/// Frames that were accepted, and targets that wait for a SYNC.
#[derive(Clone, Debug)]
pub(super) struct Age {
    /// Accepted frames of each bus, the oldest first.
    taken: Vec<VecDeque<(Instant, Frame)>>,
    /// Target that acts at the next SYNC, with the time at which it was sent.
    waiting: [Option<(Instant, i16)>; 6],
    /// Age of each target when it began to act; zero for a target of zero.
    acting: [Duration; 6],
    /// Number of non-zero targets that were stale on the wire.
    pub(super) delivered: u64,
}

impl Age {
    pub(super) fn new(buses: usize) -> Self {
        Self {
            taken: vec![VecDeque::new(); buses],
            waiting: [None; 6],
            acting: [Duration::ZERO; 6],
            delivered: 0,
        }
    }

    /// Takes a frame that a bus has accepted.
    pub(super) fn on_taken(&mut self, at: Instant, telegram: &Telegram) {
        let Channel(bus) = telegram.channel;
        if let Some(taken) = self.taken.get_mut(usize::from(bus)) {
            taken.push_back((at, telegram.frame));
        }
    }

    /// Takes a frame on the wire; returns the time at which it was accepted. Those accepted before it were lost.
    pub(super) fn on_sent(&mut self, at: Instant, telegram: &Telegram) -> Instant {
        let Channel(bus) = telegram.channel;
        let Some(taken) = self.taken.get_mut(usize::from(bus)) else { return at };
        let place = taken.iter().position(|(_, frame)| *frame == telegram.frame);
        let gone = place.and_then(|place| taken.drain(..=place).next_back());
        gone.map_or(at, |(since, _)| since)
    }

    /// Takes a target that was sent at `since`.
    pub(super) fn on_target(
        &mut self,
        sheet: &Sheet,
        (at, since): (Instant, Instant),
        (joint, target): (Joint, i16),
    ) {
        self.delivered += u64::from(target != 0 && at.since(since) > stale(sheet.period));
        *joint.entry_mut(&mut self.waiting) = Some((since, target));
    }

    /// Takes a SYNC: the targets since the last one act from now on.
    pub(super) fn on_sync(&mut self, sheet: &Sheet, at: Instant, channel: Channel) {
        let joints = sheet.nodes.iter().zip(&mut self.waiting).zip(&mut self.acting);
        for ((_, waiting), acting) in joints.filter(|((node, _), _)| node.channel == channel) {
            if let Some((since, target)) = waiting.take() {
                *acting = if target == 0 { Duration::ZERO } else { at.since(since) };
            }
        }
    }

    /// Returns the age of each joint's target when it began to act.
    pub(super) const fn acting(&self) -> [Duration; 6] {
        self.acting
    }
}

/// Returns the maximum age of a target that is not stale.
pub(crate) fn stale(period: Duration) -> Duration {
    period * MAX_AGE
}
