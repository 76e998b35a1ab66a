//! One RPDO: received, held until its time, and missed when it does not come (CiA 301, 7.2.2.2 to
//! 7.2.2.5).
//!
//! A synchronous one acts at the *next* SYNC, an event-driven one at once. Its event timer, armed by
//! the first frame, runs in operational only.

use std::time::Duration;

use crate::canopen::device::mapping::Mapping;
use crate::canopen::device::parameter::Place;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Frame;
use crate::canopen::layout::Direction;
use crate::canopen::sync::Transmission;
use crate::time::Instant;

/// What a frame is to an RPDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Received {
    /// It waits for the next SYNC.
    Held,
    /// It acts now: this is what it says.
    Acts(u64),
    /// It is not as long as the mapping; nothing is done.
    WrongLength,
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
}

impl Rpdo {
    /// The RPDO of this number, as `dictionary` says.
    pub(super) fn new(dictionary: &Dictionary, number: u16) -> Self {
        let place = Place { direction: Direction::Receive, number };
        let timeout = u64::from(dictionary.unsigned(place.communication(5)));
        Self {
            place,
            cob_id: place.cob_id(dictionary),
            transmission: place.transmission(dictionary),
            timeout: (timeout > 0).then_some(Duration::from_millis(timeout)),
            mapping: place.resolve(dictionary),
            held: None,
            due: None,
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

    /// Takes a frame, in operational; `None` if it is another's.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<Received> {
        if self.cob_id != Some(frame.cob_id) {
            return None;
        }
        if frame.data().len() != self.mapping.bytes() {
            return Some(Received::WrongLength);
        }
        self.due = self.timeout.map(|timeout| now + timeout);
        let content = super::mapping::number(frame.data());
        if self.transmission.syncs().is_none() {
            return Some(Received::Acts(content));
        }
        self.held = Some(content);
        Some(Received::Held)
    }

    /// What has waited for this SYNC.
    pub(super) const fn on_sync(&mut self) -> Option<u64> {
        self.held.take()
    }

    /// Whether the next frame has been waited for too long. Said once.
    pub(super) fn is_missed(&mut self, now: Instant) -> bool {
        self.due.take_if(|due| *due <= now).is_some()
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
