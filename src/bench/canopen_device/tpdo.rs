//! One TPDO: sampled at SYNC, sent after a change or on request (CiA 301, 7.2.2.2 to 7.2.2.5).
//!
//! A synchronous TPDO may be sent later than its SYNC, with the values sampled at it; it is discarded once the
//! window is closed. An event-driven TPDO is sent on every change, between inhibit time and event timer. Remote
//! frames are answered if bit 30 of the COB-ID is 0; types 252 and 253 send on them only.

use std::time::Duration;

use crate::dictionary::Dictionary;
use crate::mapping::{Mapping, byte};
use crate::parameter::{NO_REMOTE, Place};
use crate::station::earlier;
use canopen::frame::Frame;
use canopen::layout::Direction;
use canopen::sync::{Sync, TransmissionType};
use units::time::Instant;

/// One configured TPDO.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tpdo {
    place: Place,
    cob_id: Option<u16>,
    transmission: TransmissionType,
    /// Set if remote frames are answered.
    is_remote: bool,
    /// SYNC start value (sub-index 6): counter of the first SYNC; 0 for any.
    start: u8,
    inhibit: Duration,
    period: Option<Duration>,
    mapping: Mapping,
    /// Content sent last.
    sent: Option<u64>,
    /// Set until the first SYNC.
    waits: bool,
    /// SYNCs since the last sample.
    syncs: u8,
    /// Sampled content, and its time of transmission.
    sampled: Option<(Instant, u64)>,
    /// Set if the content has changed since.
    has_changed: bool,
    /// Earliest time of the next transmission.
    inhibited: Instant,
    /// Latest time of the next transmission.
    due: Option<Instant>,
}

impl Tpdo {
    /// Resolves COB-ID, mapping and timers of TPDO `number` from its parameters (1800h, 1A00h and up).
    pub(super) fn new(dictionary: &Dictionary, number: u16) -> Self {
        let place = Place { direction: Direction::Transmit, number };
        let mapping = place.resolve(dictionary);
        let inhibit = u64::from(dictionary.unsigned(place.communication(3)));
        let period = u64::from(dictionary.unsigned(place.communication(5)));
        Self {
            place,
            cob_id: place.cob_id(dictionary).filter(|_| !mapping.is_empty()),
            transmission: place.transmission(dictionary),
            is_remote: dictionary.unsigned(place.communication(1)) & NO_REMOTE == 0,
            start: byte(dictionary, place.communication(6)),
            inhibit: Duration::from_micros(100 * inhibit),
            period: (period > 0).then_some(Duration::from_millis(period)),
            mapping,
            sent: None,
            waits: true,
            syncs: 0,
            sampled: None,
            has_changed: false,
            inhibited: Instant::ZERO,
            due: None,
        }
    }

    /// Place of the PDO.
    pub(super) const fn place(&self) -> Place {
        self.place
    }

    /// Returns whether changes trigger a transmission.
    pub(super) const fn is_event_driven(&self) -> bool {
        self.cob_id.is_some() && self.transmission.is_event_driven()
    }

    /// Enters operational: an event-driven TPDO is sent at once.
    pub(super) const fn start(&mut self) {
        self.stop();
        self.has_changed = self.is_event_driven();
    }

    /// Leaves operational: pending samples and times are dropped.
    pub(super) const fn stop(&mut self) {
        self.sent = None;
        self.waits = true;
        self.syncs = 0;
        self.sampled = None;
        self.has_changed = false;
        self.due = None;
    }

    /// Samples at its SYNC; sent at `send`, or on request.
    pub(super) fn on_sync(&mut self, sync: Sync, send: Instant, dictionary: &Dictionary) {
        if self.transmission == TransmissionType::SYNC_ON_REQUEST {
            self.sent = Some(self.mapping.gather(dictionary));
        }
        let (Some(syncs), Some(_)) = (self.transmission.syncs(), self.cob_id) else { return };
        let is_first = self.start == 0 || sync.counter.is_none_or(|counter| counter == self.start);
        if self.waits && !is_first {
            return;
        }
        self.waits = false;
        self.syncs = self.syncs.saturating_add(1);
        if self.syncs < syncs {
            return;
        }
        self.syncs = 0;
        let content = self.mapping.gather(dictionary);
        if self.transmission != TransmissionType::SYNC_ON_CHANGE || self.sent != Some(content) {
            self.sampled = Some((send, content));
        }
    }

    /// Answers a remote frame in operational; `None` if it is not its own. A synchronous TPDO answers with its
    /// last sample.
    pub(super) fn on_request(&self, request: &Frame, dictionary: &Dictionary) -> Option<Frame> {
        if self.cob_id != Some(request.cob_id) || !self.is_remote {
            return None;
        }
        let sampled = self.sent.filter(|_| self.transmission.is_synchronous());
        self.frame(sampled.unwrap_or_else(|| self.mapping.gather(dictionary)))
    }

    /// Detects a change of the content.
    pub(super) fn compare(&mut self, dictionary: &Dictionary) {
        if self.is_event_driven() && self.sent != Some(self.mapping.gather(dictionary)) {
            self.has_changed = true;
        }
    }

    /// Sends frames due in operational. Returns false if a sample was discarded because the window is closed.
    pub(super) fn on_time(
        &mut self,
        now: Instant,
        is_open: bool,
        dictionary: &Dictionary,
        out: &mut Vec<Frame>,
    ) -> bool {
        let sampled = self.sampled.take_if(|(send, _)| *send <= now);
        let is_in_time = is_open || sampled.is_none();
        if let Some((_, content)) = sampled.filter(|_| is_open) {
            self.transmit(content, out);
        }
        if self.event().is_some_and(|due| due <= now) {
            self.has_changed = false;
            self.inhibited = now + self.inhibit;
            self.due = self.period.map(|period| now + period);
            self.transmit(self.mapping.gather(dictionary), out);
        }
        is_in_time
    }

    /// Time of the next call of [`on_time`](Self::on_time).
    pub(super) fn deadline(&self) -> Option<Instant> {
        earlier(self.sampled.map(|(send, _)| send), self.event())
    }

    /// Next transmission of an event-driven TPDO, as far as it is known.
    fn event(&self) -> Option<Instant> {
        if !self.is_event_driven() {
            return None;
        }
        let changed = self.has_changed.then_some(self.inhibited);
        earlier(changed, self.due.map(|due| due.max(self.inhibited)))
    }

    fn transmit(&mut self, content: u64, out: &mut Vec<Frame>) {
        self.sent = Some(content);
        out.extend(self.frame(content));
    }

    fn frame(&self, content: u64) -> Option<Frame> {
        let bytes = content.to_le_bytes();
        let data = bytes.get(..self.mapping.bytes()).unwrap_or_default();
        self.cob_id.and_then(|cob_id| Frame::from_slice(cob_id, data))
    }
}
