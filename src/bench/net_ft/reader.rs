//! Reader of a sensor's records: selects the reading among them, and requests them. No I/O, no clock.
//!
//! The newest record wins. It becomes the reading if
//! - it comes from the sensor's address and port, and has the length of a record;
//! - its RDT sequence follows that of the record before: repeated and overtaken records have no effect, and the first record
//!   after a gap has none, independently of the cause of the gap;
//! - its F/T sequence differs from that of the record before: the sensor has measured again;
//! - it has not waited: it was received since the socket was last found empty, at most `max_wait` ago. RDT records have no time
//!   stamps, so records that waited for a stopped process, or behind a flood of datagrams, may be of any age.
//!
//! A status other than 0 makes the reading invalid, not zero.

use std::net::SocketAddr;
use std::time::Duration;

use derive_more::Display;

use crate::rdt::{Record, Request};
use crate::scale::Scale;
use units::spatial::Wrench;
use units::time::Instant;

/// Time after which a sensor without a new reading gets another request.
pub const RETRY_AFTER: Duration = Duration::from_millis(100);

/// Minimum forward distance of RDT sequences at which a record counts as overtaken.
const HALF: u32 = 1 << 31;

/// Reading of the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Number of the reading; 0 before the first.
    pub number: u64,
    /// Wrench in the sensor's own frame; `None` before the first record, and if the status is invalid.
    pub wrench: Option<Wrench>,
}

/// Condition of the records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display)]
pub enum Condition {
    /// No new reading for `max_wait`.
    #[display("silent")]
    Silent,
    /// Status 0.
    #[display("valid")]
    Valid,
    /// Another status.
    #[display("status {_0:08X}h")]
    Invalid(u32),
}

/// Counts of datagrams since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Records of the sensor.
    pub records: u64,
    /// Records that are missing in the RDT sequence.
    pub lost: u64,
    /// Records that were repeated or overtaken.
    pub overtaken: u64,
    /// Records with the F/T sequence of the one before.
    pub frozen: u64,
    /// Records that may have waited for longer than `max_wait`.
    pub waited: u64,
    /// Readings with a status other than 0.
    pub invalid: u64,
    /// Datagrams of the sensor that are no records.
    pub malformed: u64,
    /// Datagrams of other addresses or ports.
    pub foreign: u64,
    /// Requests to stream.
    pub requests: u64,
}

/// Reader of one sensor.
#[derive(Clone, Debug)]
pub struct Reader {
    sensor: SocketAddr,
    scale: Scale,
    max_wait: Duration,
    /// Newest record since the last request to stream.
    newest: Option<Record>,
    reading: Reading,
    /// Status of the reading.
    status: u32,
    /// Time of the newest reading; of the start before the first.
    read_at: Instant,
    /// Time at which the socket was last found empty; initially of the start.
    emptied: Instant,
    requested: Option<Instant>,
    is_bias_due: bool,
    /// Newest source of foreign datagrams.
    foreign: Option<SocketAddr>,
    counts: Counts,
}

impl Reader {
    /// Creates a reader at the time of the start. `max_wait` is the longest time between two reads of the socket, and the time
    /// without a new reading after which the sensor is silent.
    pub const fn new(sensor: SocketAddr, scale: Scale, max_wait: Duration, now: Instant) -> Self {
        Self {
            sensor,
            scale,
            max_wait,
            newest: None,
            reading: Reading { number: 0, wrench: None },
            status: 0,
            read_at: now,
            emptied: now,
            requested: None,
            is_bias_due: false,
            foreign: None,
            counts: Counts {
                records: 0,
                lost: 0,
                overtaken: 0,
                frozen: 0,
                waited: 0,
                invalid: 0,
                malformed: 0,
                foreign: 0,
                requests: 0,
            },
        }
    }

    /// Requests a bias, which sets the present load as zero, once the sensor streams valid records.
    pub const fn bias(&mut self) {
        self.is_bias_due = true;
    }

    /// Processes a datagram from the read of the socket that started at `now`.
    pub fn on_datagram(&mut self, now: Instant, source: SocketAddr, bytes: &[u8]) {
        if (source.ip(), source.port()) != (self.sensor.ip(), self.sensor.port()) {
            self.counts.foreign += 1;
            self.foreign = Some(source);
            return;
        }
        let Some(record) = Record::decode(bytes) else {
            self.counts.malformed += 1;
            return;
        };
        self.counts.records += 1;
        let ahead = self
            .newest
            .map(|newest| record.rdt_sequence.wrapping_sub(newest.rdt_sequence))
            .unwrap_or_default();
        if self.newest.is_some() && (ahead == 0 || ahead >= HALF) {
            self.counts.overtaken += 1;
            return;
        }
        self.counts.lost += u64::from(ahead.saturating_sub(1));
        let before = self.newest.replace(record);
        let is_frozen = before.is_some_and(|before| before.ft_sequence == record.ft_sequence);
        let has_waited = now.since(self.emptied) > self.max_wait;
        self.counts.frozen += u64::from(is_frozen);
        self.counts.waited += u64::from(has_waited);
        if ahead == 1 && !is_frozen && !has_waited {
            self.accept(now, &record);
        }
    }

    /// Records that the read of the socket that started at `now` emptied it.
    pub const fn on_empty(&mut self, now: Instant) {
        self.emptied = now;
    }

    /// Returns the requests to send now, after the read of the socket at `now`.
    pub fn requests(&mut self, now: Instant) -> impl Iterator<Item = Request> + use<> {
        let is_biased = self.is_bias_due && self.condition(now) == Condition::Valid;
        let is_late = |asked: Instant| now >= self.read_at.max(asked) + RETRY_AFTER;
        let is_due = is_biased || self.requested.is_none_or(is_late);
        if is_biased {
            self.is_bias_due = false;
        }
        if is_due {
            // The sensor restarts its sequence.
            self.newest = None;
            self.requested = Some(now);
            self.counts.requests += 1;
        }
        let bias = is_biased.then_some(Request::Bias);
        bias.into_iter().chain(is_due.then_some(Request::Stream))
    }

    /// Returns the newest reading.
    pub const fn reading(&self) -> Reading {
        self.reading
    }

    /// Returns the condition of the records at `now`.
    pub fn condition(&self, now: Instant) -> Condition {
        if self.reading.number == 0 || now.since(self.read_at) >= self.max_wait {
            Condition::Silent
        } else if self.status == 0 {
            Condition::Valid
        } else {
            Condition::Invalid(self.status)
        }
    }

    /// Returns the address of the sensor.
    pub const fn sensor(&self) -> SocketAddr {
        self.sensor
    }

    /// Returns the newest source of datagrams that are not the sensor's.
    pub const fn foreign(&self) -> Option<SocketAddr> {
        self.foreign
    }

    /// Returns the counts of records, datagrams and requests since the start.
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Accepts a record as the reading.
    fn accept(&mut self, now: Instant, record: &Record) {
        let is_valid = record.status == 0;
        self.counts.invalid += u64::from(!is_valid);
        self.status = record.status;
        self.read_at = now;
        self.reading = Reading {
            number: self.reading.number + 1,
            wrench: is_valid.then(|| self.scale.wrench(record.counts)),
        };
    }
}

#[cfg(test)]
mod tests;
