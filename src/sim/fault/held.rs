//! Frames that are late.

use std::collections::VecDeque;

use crate::fault::breakable::Way;
use canopen::frame::Telegram;
use units::numbering::NodeIndex;
use units::time::Instant;

/// A frame that is late, and between whom.
#[derive(Clone, Copy, Debug)]
pub(super) struct Late {
    pub(super) due: Instant,
    pub(super) place: NodeIndex,
    pub(super) way: Way,
    pub(super) telegram: Telegram,
    /// Whether those of the same identifier behind it may come before it.
    pub(super) may_be_overtaken: bool,
}

/// All of them, in the order in which they come.
#[derive(Clone, Debug, Default)]
pub(super) struct Held(VecDeque<Late>);

impl Held {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// When the first one comes.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.0.front().map(|late| late.due)
    }

    /// Until when a frame must wait, because one of its identifier is before it.
    pub(super) fn before(&self, place: NodeIndex, way: Way, cob_id: u16) -> Option<Instant> {
        let is_before = |late: &&Late| {
            let same = (late.place, late.way, late.telegram.frame.cob_id) == (place, way, cob_id);
            same && !late.may_be_overtaken
        };
        self.0.iter().rev().find(is_before).map(|late| late.due)
    }

    /// Keeps a frame until it is due, behind those that are due then too.
    pub(super) fn keep(&mut self, late: Late) {
        let place = self.0.partition_point(|other| other.due <= late.due);
        self.0.insert(place, late);
    }

    /// The first one, if it is due.
    pub(super) fn take_due(&mut self, now: Instant) -> Option<Late> {
        self.deadline().filter(|due| *due <= now).and_then(|_| self.0.pop_front())
    }
}
