//! Record of the newest round trips of the link.

use std::time::Duration;

/// Maximum number of round trips: 1 s at 1 kHz.
const LENGTH: usize = 1_000;

/// Newest round trips, from a command to the message that echoes it.
#[derive(Clone, Debug, Default)]
pub struct RoundTrips {
    newest: Vec<Duration>,
    next: usize,
}

impl RoundTrips {
    /// Creates an empty record. Allocates once.
    pub(crate) fn new() -> Self {
        Self { newest: Vec::with_capacity(LENGTH), ..Self::default() }
    }

    /// Adds a round trip; replaces the oldest one of a full record.
    pub(crate) fn add(&mut self, duration: Duration) {
        match self.newest.get_mut(self.next) {
            Some(place) => *place = duration,
            None => self.newest.push(duration),
        }
        self.next = (self.next + 1) % LENGTH;
    }

    /// Returns the number of round trips in the record, at most 1,000.
    pub const fn count(&self) -> usize {
        self.newest.len()
    }

    /// Returns a percentile of the round trips; `None` for an empty record. Sorts a copy.
    pub fn percentile(&self, percent: usize) -> Option<Duration> {
        let mut sorted = self.newest.clone();
        sorted.sort_unstable();
        let place = sorted.len().checked_sub(1)? * percent.min(100) / 100;
        sorted.get(place).copied()
    }
}
