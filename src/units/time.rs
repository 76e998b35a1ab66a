//! Time as a number of microseconds. Only a bus reads a clock.

use std::ops::{Add, Sub};
use std::time::Duration;

/// Point in time, in microseconds since the bus was opened.
///
/// One microsecond is the duration of a bit at 1 Mbit/s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant(u64);

impl Instant {
    /// Time at which the bus was opened.
    pub const ZERO: Self = Self(0);

    /// Creates the time `micros` µs after the bus was opened.
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// Returns the microseconds since the bus was opened.
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// Returns the duration since `earlier`; zero if `earlier` is later.
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    /// Adds `span`, truncated to microseconds; saturates.
    fn add(self, span: Duration) -> Self {
        let micros = u64::try_from(span.as_micros()).unwrap_or(u64::MAX);
        Self(self.0.saturating_add(micros))
    }
}

impl Sub<Duration> for Instant {
    type Output = Self;

    /// Subtracts `span`, truncated to microseconds; saturates at zero.
    fn sub(self, span: Duration) -> Self {
        let micros = u64::try_from(span.as_micros()).unwrap_or(u64::MAX);
        Self(self.0.saturating_sub(micros))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adding_a_span_and_subtracting_it_are_inverse() {
        let start = Instant::from_micros(1_500);
        let span = Duration::from_micros(250);
        assert_eq!((start + span).since(start), span);
        assert_eq!((start + span) - span, start);
    }

    #[test]
    fn differences_are_never_negative() {
        let (early, late) = (Instant::from_micros(3), Instant::from_micros(5));
        assert_eq!(early.since(late), Duration::ZERO);
        assert_eq!(early - Duration::from_secs(1), Instant::ZERO);
    }
}
