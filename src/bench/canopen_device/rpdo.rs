//! One RPDO: received, held until it acts, and timed out if it is lost (CiA 301, 7.2.2.2 to 7.2.2.5).
//!
//! A synchronous RPDO acts at the next SYNC, an event-driven one at once. A frame longer than the mapping is
//! cut; a shorter one is ignored (7.5.2.36). The event timer starts with the first frame and runs in
//! operational only. The inhibit time has no effect on reception.

use std::time::Duration;

use crate::condition::{Condition, Conditions};
use crate::dictionary::Dictionary;
use crate::mapping::Mapping;
use crate::parameter::Place;
use canopen::frame::Frame;
use canopen::layout::Direction;
use canopen::sync::TransmissionType;
use units::time::Instant;

/// Effect of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reception {
    /// Held until the next SYNC.
    Held,
    /// Acts now, with this content.
    Acts(u64),
    /// Ignored: the frame is too short.
    Ignored,
    /// Ignored: the RPDO is synchronous and the window is closed.
    Late,
}

/// One configured RPDO.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rpdo {
    place: Place,
    cob_id: Option<u16>,
    transmission: TransmissionType,
    timeout: Option<Duration>,
    mapping: Mapping,
    held: Option<u64>,
    due: Option<Instant>,
    conditions: Conditions,
}

impl Rpdo {
    /// Resolves COB-ID, mapping and timer of RPDO `number` from its parameters (1400h, 1600h and up).
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
            conditions: Conditions::default(),
        }
    }

    /// Place of the PDO.
    pub(super) const fn place(&self) -> Place {
        self.place
    }

    /// COB-ID; `None` while the PDO is disabled.
    pub(super) const fn cob_id(&self) -> Option<u16> {
        self.cob_id
    }

    /// Mapping of the PDO.
    pub(super) const fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// Error conditions of its reception.
    pub(super) const fn conditions(&self) -> Conditions {
        self.conditions
    }

    /// Takes a frame in operational; `None` if it is not its own. Synchronous RPDOs are accepted while the
    /// window `is_open`.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        is_open: bool,
        frame: &Frame,
    ) -> Option<Reception> {
        if self.cob_id != Some(frame.cob_id) {
            return None;
        }
        let (length, mapped) = (frame.data().len(), self.mapping.bytes());
        self.conditions.set(Condition::RpdoTooShort, length < mapped);
        self.conditions.set(Condition::RpdoTooLong, length > mapped);
        if length < mapped {
            return Some(Reception::Ignored);
        }
        let is_synchronous = self.transmission.syncs().is_some();
        if is_synchronous && !is_open {
            return Some(Reception::Late);
        }
        self.conditions.set(Condition::RpdoTimeout, false);
        self.due = self.timeout.map(|timeout| now + timeout);
        let content = super::mapping::number(frame.data());
        if is_synchronous {
            self.held = Some(content);
            return Some(Reception::Held);
        }
        Some(Reception::Acts(content))
    }

    /// Takes the content held for this SYNC.
    pub(super) const fn on_sync(&mut self) -> Option<u64> {
        self.held.take()
    }

    /// Returns whether the event timer has expired since the last call.
    pub(super) fn detect_timeout(&mut self, now: Instant) -> bool {
        let is_expired = self.due.take_if(|due| *due <= now).is_some();
        if is_expired {
            self.conditions.set(Condition::RpdoTimeout, true);
        }
        is_expired
    }

    /// Time at which the event timer expires.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        self.due
    }

    /// Leaves operational: stops the event timer and discards held content.
    pub(super) const fn stop(&mut self) {
        self.held = None;
        self.due = None;
    }
}
