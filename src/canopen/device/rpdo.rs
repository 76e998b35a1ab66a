//! One RPDO: received, held until its time, and missed when it does not come (CiA 301, 7.2.2.2 to
//! 7.2.2.5).
//!
//! A synchronous one acts at the *next* SYNC, an event-driven one at once. Of a frame longer than the
//! mapping the first bytes count; a shorter one is not taken (7.5.2.36). The event timer, armed by the
//! first frame, runs in operational only. Its inhibit time means nothing to one who receives.

use std::time::Duration;

use crate::device::condition::Condition;
use crate::device::condition::Conditions;
use crate::device::mapping::Mapping;
use crate::device::parameter::Place;
use crate::dictionary::Dictionary;
use crate::frame::Frame;
use crate::layout::Direction;
use crate::sync::Transmission;
use units::time::Instant;

/// What a frame is to an RPDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Received {
    /// It waits for the next SYNC.
    Held,
    /// It acts now: this is what it says.
    Acts(u64),
    /// Nothing is done: it is too short.
    Passed,
    /// Nothing is done: it is synchronous, and the window is closed.
    Late,
}

/// One RPDO, as it is configured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rpdo {
    place: Place,
    cob_id: Option<u16>,
    transmission: Transmission,
    timeout: Option<Duration>,
    mapping: Mapping,
    held: Option<u64>,
    due: Option<Instant>,
    wrong: Conditions,
}

impl Rpdo {
    /// The RPDO of this number, as `dictionary` says.
    pub(super) fn new(dictionary: &Dictionary, number: u16) -> Self {
        let place = Place { direction: Direction::Receive, number };
        let mapping = place.resolve(dictionary);
        let timeout = u64::from(dictionary.unsigned(place.communication(5)));
        Self {
            place,
            cob_id: place.cob_id(dictionary).filter(|_| !mapping.is_empty()),
            transmission: place.transmission(dictionary),
            timeout: (timeout > 0).then_some(Duration::from_millis(timeout)),
            mapping,
            held: None,
            due: None,
            wrong: Conditions::default(),
        }
    }

    /// Which PDO this is.
    pub(super) const fn place(&self) -> Place {
        self.place
    }

    /// What is in it.
    pub(super) const fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// What is wrong with what it receives.
    pub(super) const fn wrong(&self) -> Conditions {
        self.wrong
    }

    /// Takes a frame, in operational; `None` if it is another's. Synchronous ones are taken while the window
    /// `is_open`.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        is_open: bool,
        frame: &Frame,
    ) -> Option<Received> {
        if self.cob_id != Some(frame.cob_id) {
            return None;
        }
        let (length, mapped) = (frame.data().len(), self.mapping.bytes());
        self.wrong.set(Condition::RpdoTooShort, length < mapped);
        self.wrong.set(Condition::RpdoTooLong, length > mapped);
        if length < mapped {
            return Some(Received::Passed);
        }
        let is_synchronous = self.transmission.syncs().is_some();
        if is_synchronous && !is_open {
            return Some(Received::Late);
        }
        self.wrong.set(Condition::RpdoTimeout, false);
        self.due = self.timeout.map(|timeout| now + timeout);
        let content = super::mapping::number(frame.data());
        if is_synchronous {
            self.held = Some(content);
            return Some(Received::Held);
        }
        Some(Received::Acts(content))
    }

    /// What has waited for this SYNC.
    pub(super) const fn on_sync(&mut self) -> Option<u64> {
        self.held.take()
    }

    /// Whether the next frame has been waited for too long, since this was asked last.
    pub(super) fn misses(&mut self, now: Instant) -> bool {
        let misses = self.due.take_if(|due| *due <= now).is_some();
        if misses {
            self.wrong.set(Condition::RpdoTimeout, true);
        }
        misses
    }

    /// When the next frame will have been waited for too long.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        self.due
    }

    /// Operational is left: nothing is waited for, and what is held never acts.
    pub(super) const fn stop(&mut self) {
        self.held = None;
        self.due = None;
    }
}
