//! Detection of a second event within a time: a single one is tolerated.

use std::time::Duration;

use units::time::Instant;

/// Time of the last event.
#[derive(Clone, Copy, Debug)]
pub(super) struct RepeatDetector {
    within: Duration,
    last: Option<Instant>,
}

impl RepeatDetector {
    /// Returns a detector before any event. An event more than `within` after the last one counts as the first.
    pub(super) const fn new(within: Duration) -> Self {
        Self { within, last: None }
    }

    /// Takes an event at `now`. Returns whether the one before was within the time.
    pub(super) fn on_event(&mut self, now: Instant) -> bool {
        let last = self.last.replace(now);
        last.is_some_and(|last| now.since(last) <= self.within)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_event_within_the_time_is_a_repeat() {
        let mut detector = RepeatDetector::new(Duration::from_millis(100));
        let mut at = |millis: u64| detector.on_event(Instant::from_micros(1_000 * millis));
        assert_eq!([at(0), at(101), at(201), at(202)], [false, false, true, true]);
    }
}
