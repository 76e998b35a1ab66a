//! Queue of delayed frames, by due time.

use std::collections::VecDeque;

use crate::fault::breakable::Direction;
use canopen::frame::Telegram;
use units::numbering::NodeIndex;
use units::time::Instant;

/// Delayed frame of the device at `place`.
#[derive(Clone, Copy, Debug)]
pub(super) struct DelayedFrame {
    pub(super) due: Instant,
    pub(super) place: NodeIndex,
    pub(super) direction: Direction,
    pub(super) telegram: Telegram,
    /// Later frames of the same COB-ID may overtake it.
    pub(super) may_be_overtaken: bool,
}

/// All delayed frames, in the order in which they are due.
#[derive(Clone, Debug, Default)]
pub(super) struct DelayQueue(VecDeque<DelayedFrame>);

impl DelayQueue {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the time at which the first one is due.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.0.front().map(|delayed| delayed.due)
    }

    /// Returns the time until which a frame must wait behind an earlier one of its COB-ID.
    pub(super) fn before(
        &self,
        place: NodeIndex,
        direction: Direction,
        cob_id: u16,
    ) -> Option<Instant> {
        let is_before = |delayed: &&DelayedFrame| {
            let its = (delayed.place, delayed.direction, delayed.telegram.frame.cob_id);
            its == (place, direction, cob_id) && !delayed.may_be_overtaken
        };
        self.0.iter().rev().find(is_before).map(|delayed| delayed.due)
    }

    /// Keeps a frame until it is due, behind those that are due at the same time.
    pub(super) fn keep(&mut self, delayed: DelayedFrame) {
        let place = self.0.partition_point(|other| other.due <= delayed.due);
        self.0.insert(place, delayed);
    }

    /// Takes the first frame if it is due.
    pub(super) fn take_due(&mut self, now: Instant) -> Option<DelayedFrame> {
        self.deadline().filter(|due| *due <= now).and_then(|_| self.0.pop_front())
    }
}
