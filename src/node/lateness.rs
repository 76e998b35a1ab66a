//! Lateness of the loop: late wake-ups, stalls and host suspension.
//!
//! A wake-up more than half a period late skips its cycle (see [schedule](crate::schedule)), which is harmless once.
//! Too many of them and long stalls are faults: the drives' timers may have expired, and received frames are stale.

use std::time::Duration;

use crate::cause::Cause;
use units::time::Instant;

/// Maximum number of cycles that a stall may skip. Skipped cycles are counted.
pub(super) const MAX_SKIPPED_CYCLES: u64 = 5;

/// Number of consecutive late cycles that is a fault.
const CONSECUTIVE_LATE_LIMIT: u32 = 3;

/// Number of late cycles within [`LATE_WINDOW`] that is a fault.
const LATE_LIMIT: usize = 10;

/// Time for which a late cycle counts.
const LATE_WINDOW: Duration = Duration::from_secs(1);

/// Minimum growth of the suspension time that counts as a suspension. Two clocks are read one after the other.
pub(super) const MIN_SUSPENSION: Duration = Duration::from_millis(1);

/// Watch for late cycles, stalls and host suspension.
#[derive(Clone, Debug)]
pub(super) struct Lateness {
    period: Duration,
    consecutive: u32,
    /// Start times of the last late cycles; the oldest is at `oldest`.
    late: [Option<Instant>; LATE_LIMIT],
    oldest: usize,
    /// Time of host suspension so far.
    suspended: Duration,
    /// Number of cycles with dropped targets or a skipped SYNC.
    overruns: u64,
    /// True if a late target of this cycle was dropped.
    has_dropped: bool,
}

impl Lateness {
    /// Returns a watch without late cycles. `suspended` is the time of host suspension so far.
    pub(super) const fn new(period: Duration, suspended: Duration) -> Self {
        let late = [None; LATE_LIMIT];
        Self { period, consecutive: 0, late, oldest: 0, suspended, overruns: 0, has_dropped: false }
    }

    /// Returns the number of cycles whose targets were late, or whose next SYNC slot was skipped.
    pub(super) const fn overruns(&self) -> u64 {
        self.overruns
    }

    /// Counts a cycle with late targets, once. The next SYNC slot is skipped then, too, and not counted again.
    pub(super) const fn on_dropped_target(&mut self) {
        if !self.has_dropped {
            self.overruns += 1;
        }
        self.has_dropped = true;
    }

    /// Starts a cycle after `skipped` SYNC slots. Returns a cause if the gap is too long, or late cycles are too many.
    pub(super) fn start_cycle(&mut self, now: Instant, skipped: u64) -> Option<Cause> {
        let is_counted = std::mem::take(&mut self.has_dropped);
        if skipped == 0 && !is_counted {
            self.consecutive = 0;
            return None;
        }
        self.overruns += u64::from(!is_counted);
        self.consecutive = self.consecutive.saturating_add(1);
        let slot = self.late.get_mut(self.oldest)?;
        *slot = Some(now);
        self.oldest = (self.oldest + 1) % LATE_LIMIT;
        let before = self.late.get(self.oldest).copied().flatten();
        let is_frequent = before.is_some_and(|before| now.since(before) < LATE_WINDOW);
        if skipped > MAX_SKIPPED_CYCLES {
            Some(Cause::Overrun { cycles: skipped })
        } else {
            (self.consecutive >= CONSECUTIVE_LATE_LIMIT || is_frequent).then_some(Cause::Late)
        }
    }

    /// Returns a cause if the loop stalled from `due` to `now` for too long.
    pub(super) fn watch_stall(&self, due: Instant, now: Instant) -> Option<Cause> {
        let cycles = now.since(due).as_micros() / self.period.as_micros().max(1);
        let cycles = u64::try_from(cycles).unwrap_or(u64::MAX);
        (cycles > MAX_SKIPPED_CYCLES).then_some(Cause::Overrun { cycles })
    }

    /// Returns whether data of the time `at` is older than 1.5 periods.
    pub(super) fn is_stale(&self, at: Instant, now: Instant) -> bool {
        now.since(at) > self.period + self.period / 2
    }

    /// Returns a cause if the host was suspended since the last call. `suspended` is its time of suspension so far.
    pub(super) fn watch_suspension(&mut self, suspended: Duration) -> Option<Cause> {
        let before = std::mem::replace(&mut self.suspended, suspended);
        (suspended.saturating_sub(before) > MIN_SUSPENSION).then_some(Cause::Suspended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(1);

    fn lateness() -> Lateness {
        Lateness::new(PERIOD, Duration::from_secs(40))
    }

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    /// Returns the causes of cycles that start at these ms, each after this number of skipped slots.
    fn causes(starts: impl IntoIterator<Item = (u64, u64)>) -> Vec<Option<Cause>> {
        let mut lateness = lateness();
        starts
            .into_iter()
            .map(|(millis, skipped)| lateness.start_cycle(at(millis), skipped))
            .collect()
    }

    #[test]
    fn hazard_29_three_consecutive_late_cycles_stop_and_two_do_not() {
        assert_eq!(causes([(1, 1), (3, 1), (5, 1)]), [None, None, Some(Cause::Late)]);
        assert_eq!(causes([(1, 1), (3, 1), (4, 0), (6, 1), (8, 1)]), [None; 5]);
    }

    #[test]
    fn hazard_29_ten_late_cycles_within_a_second_stop() {
        let apart = |millis: u64| (0..30).flat_map(move |n| [(n * millis, 1), (n * millis + 1, 0)]);
        let first = causes(apart(111)).into_iter().position(|cause| cause.is_some());
        assert_eq!(first, Some(18), "the tenth, 999 ms after the first");
        assert!(causes(apart(112)).iter().all(Option::is_none));
    }

    #[test]
    fn hazard_29_cycles_with_dropped_targets_count_once_as_overruns() {
        let mut lateness = lateness();
        for cycle in 1..=3 {
            assert_eq!(lateness.overruns(), cycle - 1);
            lateness.on_dropped_target();
            lateness.on_dropped_target();
            assert_eq!(lateness.overruns(), cycle);
            let late = lateness.start_cycle(at(2 * cycle), 1);
            assert_eq!(late, (cycle == 3).then_some(Cause::Late));
        }
        assert_eq!(lateness.start_cycle(at(8), 1), Some(Cause::Late), "without a drop");
        assert_eq!((lateness.start_cycle(at(9), 0), lateness.overruns()), (None, 4));
    }

    #[test]
    fn hazard_29_gap_of_more_than_five_periods_stops() {
        assert_eq!(causes([(10, 5)]), [None]);
        assert_eq!(causes([(10, 6)]), [Some(Cause::Overrun { cycles: 6 })]);
        assert_eq!(lateness().watch_stall(at(10), at(15)), None);
        let cause = Some(Cause::Overrun { cycles: 6 });
        assert_eq!(lateness().watch_stall(at(10), at(16)), cause);
    }

    #[test]
    fn data_older_than_one_and_a_half_periods_is_stale() {
        let (sync_at, limit) = (at(10), Instant::from_micros(11_500));
        assert!(!lateness().is_stale(sync_at, limit));
        assert!(lateness().is_stale(sync_at, limit + Duration::from_micros(1)));
    }

    #[test]
    fn hazard_31_host_suspension_is_reported_once() {
        let mut lateness = lateness();
        let suspended = [40_000, 40_001, 43_000, 43_000].map(Duration::from_millis);
        let causes = suspended.map(|suspended| lateness.watch_suspension(suspended));
        assert_eq!(causes, [None, None, Some(Cause::Suspended), None]);
    }
}
