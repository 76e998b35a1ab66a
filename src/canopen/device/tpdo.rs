//! One TPDO: sampled at the SYNC, or sent when something has changed (CiA 301, 7.2.2.2 to 7.2.2.5).
//!
//! A synchronous one may be sent a while after its SYNC, as real devices do, but what it says is what
//! was true *at* the SYNC. An event-driven one is sent on every change, no sooner than its inhibit time
//! and no later than its event timer allow.

use std::time::Duration;

use crate::canopen::device::mapping::Mapping;
use crate::canopen::device::parameter::Place;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Frame;
use crate::canopen::layout::Direction;
use crate::canopen::sync::Transmission;
use crate::time::Instant;

/// One TPDO, as it is configured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tpdo {
    place: Place,
    cob_id: Option<u16>,
    transmission: Transmission,
    inhibit: Duration,
    period: Option<Duration>,
    mapping: Mapping,
    /// What was last said.
    said: Option<u64>,
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
        let inhibit = u64::from(dictionary.unsigned(place.communication(3)));
        let period = u64::from(dictionary.unsigned(place.communication(5)));
        Self {
            place,
            cob_id: place.cob_id(dictionary),
            transmission: place.transmission(dictionary),
            inhibit: Duration::from_micros(100 * inhibit),
            period: (period > 0).then_some(Duration::from_millis(period)),
            mapping: place.resolve(dictionary),
            said: None,
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
        self.cob_id.is_some() && self.transmission.syncs().is_none()
    }

    /// Operational is entered: an event-driven one tells at once how things are.
    pub(super) const fn start(&mut self) {
        self.stop();
        self.has_changed = self.is_event_driven();
    }

    /// Operational is left.
    pub(super) const fn stop(&mut self) {
        self.said = None;
        self.syncs = 0;
        self.sampled = None;
        self.has_changed = false;
        self.due = None;
    }

    /// Samples at a SYNC, if this is one of its own; sent at `send`.
    pub(super) fn on_sync(&mut self, send: Instant, dictionary: &Dictionary) {
        let (Some(syncs), Some(_)) = (self.transmission.syncs(), self.cob_id) else { return };
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

    /// Looks whether something has changed.
    pub(super) fn look(&mut self, dictionary: &Dictionary) {
        if self.is_event_driven() && self.said != Some(self.mapping.gather(dictionary)) {
            self.has_changed = true;
        }
    }

    /// Sends what is due, in operational.
    pub(super) fn on_time(&mut self, now: Instant, dictionary: &Dictionary, out: &mut Vec<Frame>) {
        if let Some((_, content)) = self.sampled.take_if(|(send, _)| *send <= now) {
            self.say(content, out);
        }
        if self.event().is_some_and(|due| due <= now) {
            self.has_changed = false;
            self.inhibited = now + self.inhibit;
            self.due = self.period.map(|period| now + period);
            self.say(self.mapping.gather(dictionary), out);
        }
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
        let bytes = content.to_le_bytes();
        let data = bytes.get(..self.mapping.bytes()).unwrap_or_default();
        out.extend(self.cob_id.and_then(|cob_id| Frame::from_slice(cob_id, data)));
    }
}
