//! One TPDO: sampled at the SYNC, sent when something has changed, or when it is asked for (CiA 301,
//! 7.2.2.2 to 7.2.2.5).
//!
//! A synchronous one may be sent a while after its SYNC, as real devices do, but what it says is what
//! was true *at* the SYNC; what cannot go out while the window is open is discarded. An event-driven one is
//! sent on every change, no sooner than its inhibit time and no later than its event timer allow. A remote
//! frame is answered by all whose COB-ID allows it (bit 30 is 0), and by types 252 and 253 alone.

use std::time::Duration;

use crate::device::mapping::Mapping;
use crate::device::mapping::byte;
use crate::device::parameter::NO_REMOTE;
use crate::device::parameter::Place;
use crate::dictionary::Dictionary;
use crate::frame::Frame;
use crate::layout::Direction;
use crate::sync::Sync;
use crate::sync::Transmission;
use units::time::Instant;

/// One TPDO, as it is configured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tpdo {
    place: Place,
    cob_id: Option<u16>,
    transmission: Transmission,
    /// Whether it answers a remote frame.
    is_remote: bool,
    /// The counter of the SYNC that is its first, where SYNCs are counted; 0 for any (sub-index 6).
    start: u8,
    inhibit: Duration,
    period: Option<Duration>,
    mapping: Mapping,
    /// What was last said.
    said: Option<u64>,
    /// Its first SYNC has not come yet.
    waits: bool,
    /// SYNCs since the last sample.
    syncs: u8,
    /// Sampled, and when it goes out.
    sampled: Option<(Instant, u64)>,
    /// Something has changed since.
    has_changed: bool,
    /// Not before.
    inhibited: Instant,
    /// Not later.
    due: Option<Instant>,
}

impl Tpdo {
    /// The TPDO of this number, as `dictionary` says.
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
            said: None,
            waits: true,
            syncs: 0,
            sampled: None,
            has_changed: false,
            inhibited: Instant::ZERO,
            due: None,
        }
    }

    /// Which PDO this is.
    pub(super) const fn place(&self) -> Place {
        self.place
    }

    /// Whether changes make it go out.
    pub(super) const fn is_event_driven(&self) -> bool {
        self.cob_id.is_some() && self.transmission.is_event_driven()
    }

    /// Operational is entered: an event-driven one tells at once how things are.
    pub(super) const fn start(&mut self) {
        self.stop();
        self.has_changed = self.is_event_driven();
    }

    /// Operational is left.
    pub(super) const fn stop(&mut self) {
        self.said = None;
        self.waits = true;
        self.syncs = 0;
        self.sampled = None;
        self.has_changed = false;
        self.due = None;
    }

    /// Samples at a SYNC, if this is one of its own; sent at `send`, or when it is asked for.
    pub(super) fn on_sync(&mut self, sync: Sync, send: Instant, dictionary: &Dictionary) {
        if self.transmission == Transmission::SYNC_ON_REQUEST {
            self.said = Some(self.mapping.gather(dictionary));
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
        if self.transmission != Transmission::SYNC_ON_CHANGE || self.said != Some(content) {
            self.sampled = Some((send, content));
        }
    }

    /// The answer to a remote frame, in operational; `None` if it is another's. A synchronous one says what
    /// it sampled last.
    pub(super) fn on_request(&self, request: &Frame, dictionary: &Dictionary) -> Option<Frame> {
        if self.cob_id != Some(request.cob_id) || !self.is_remote {
            return None;
        }
        let sampled = self.said.filter(|_| self.transmission.is_synchronous());
        self.frame(sampled.unwrap_or_else(|| self.mapping.gather(dictionary)))
    }

    /// Looks whether something has changed.
    pub(super) fn look(&mut self, dictionary: &Dictionary) {
        if self.is_event_driven() && self.said != Some(self.mapping.gather(dictionary)) {
            self.has_changed = true;
        }
    }

    /// Sends what is due, in operational. False if what was sampled had to be discarded, as the window is no
    /// longer open.
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
            self.say(content, out);
        }
        if self.event().is_some_and(|due| due <= now) {
            self.has_changed = false;
            self.inhibited = now + self.inhibit;
            self.due = self.period.map(|period| now + period);
            self.say(self.mapping.gather(dictionary), out);
        }
        is_in_time
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.sampled.map(|(send, _)| send).into_iter().chain(self.event()).min()
    }

    /// When an event-driven one goes out next, as far as that is known.
    fn event(&self) -> Option<Instant> {
        let changed = self.has_changed.then_some(self.inhibited);
        let due = self.due.map(|due| due.max(self.inhibited));
        changed.into_iter().chain(due).min().filter(|_| self.is_event_driven())
    }

    fn say(&mut self, content: u64, out: &mut Vec<Frame>) {
        self.said = Some(content);
        out.extend(self.frame(content));
    }

    fn frame(&self, content: u64) -> Option<Frame> {
        let bytes = content.to_le_bytes();
        let data = bytes.get(..self.mapping.bytes()).unwrap_or_default();
        self.cob_id.and_then(|cob_id| Frame::from_slice(cob_id, data))
    }
}
