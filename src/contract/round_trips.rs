//! Round trips and losses of the link, over its newest messages.

use std::time::Duration;

/// Round trips that are kept: a second at 1 kHz.
const LENGTH: usize = 1_000;

/// Newest round trips, from a command to the feedback that echoes it, and lost feedbacks.
#[derive(Clone, Debug, Default)]
pub struct RoundTrips {
    newest: Vec<Duration>,
    next: usize,
    received: u64,
    lost: u64,
}

impl RoundTrips {
    /// Creates an empty record. Allocates once.
    pub(crate) fn new() -> Self {
        Self { newest: Vec::with_capacity(LENGTH), ..Self::default() }
    }

    /// Adds a feedback that echoes a command of `duration` ago, after `skipped` ones that were not received.
    pub(crate) fn add(&mut self, duration: Duration, skipped: u64) {
        self.received += 1;
        self.lost = self.lost.saturating_add(skipped);
        match self.newest.get_mut(self.next) {
            Some(place) => *place = duration,
            None => self.newest.push(duration),
        }
        self.next = (self.next + 1) % LENGTH;
    }

    /// Subtracts a feedback that was counted as lost, and is received late.
    pub(crate) const fn found(&mut self) {
        self.lost = self.lost.saturating_sub(1);
    }

    /// Returns the round trip that `percent` of the newest ones do not exceed; `None` before the first.
    pub fn percentile(&self, percent: usize) -> Option<Duration> {
        let mut sorted = self.newest.clone();
        sorted.sort_unstable();
        let place = sorted.len().checked_sub(1)? * percent.min(100) / 100;
        sorted.get(place).copied()
    }

    /// Returns the number of feedbacks received.
    pub const fn received(&self) -> u64 {
        self.received
    }

    /// Returns the number of feedbacks lost.
    pub const fn lost(&self) -> u64 {
        self.lost
    }
}
