//! Time as a number. Nothing here reads a clock: only a bus does.

use std::ops::Add;
use std::ops::Sub;
use std::time::Duration;

/// A point in time, in whole microseconds since the bus was opened.
///
/// A bit at 1 Mbit/s lasts one of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant(u64);

impl Instant {
    /// When the bus was opened.
    pub const ZERO: Self = Self(0);

    /// The point `micros` µs after the bus was opened.
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// Microseconds since the bus was opened.
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// How long after `earlier` this is; zero if it is not after it.
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    /// Later by `span`, whose part below a microsecond is dropped.
    fn add(self, span: Duration) -> Self {
        let micros = u64::try_from(span.as_micros()).unwrap_or(u64::MAX);
        Self(self.0.saturating_add(micros))
    }
}

impl Sub<Duration> for Instant {
    type Output = Self;

    /// Earlier by `span`, but not before the bus was opened.
    fn sub(self, span: Duration) -> Self {
        let micros = u64::try_from(span.as_micros()).unwrap_or(u64::MAX);
        Self(self.0.saturating_sub(micros))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_added_is_the_span_between() {
        let start = Instant::from_micros(1_500);
        let span = Duration::from_micros(250);
        assert_eq!((start + span).since(start), span);
        assert_eq!((start + span) - span, start);
    }

    #[test]
    fn time_does_not_run_backwards() {
        let (early, late) = (Instant::from_micros(3), Instant::from_micros(5));
        assert_eq!(early.since(late), Duration::ZERO);
        assert_eq!(early - Duration::from_secs(1), Instant::ZERO);
    }
}
