//! Lateness of the loop: late wake-ups, standstill, a host that was suspended.
//!
//! A wake-up that is more than half a period late skips its cycle (the [schedule](crate::schedule)
//! does), and one such cycle harms nobody. Too many of them do, and so does standing still for long: the
//! drives may have stopped by their own timers, and what waits to be read is old.

use std::time::Duration;

use crate::cause::Cause;
use units::time::Instant;

/// Standing still for more cycles than this is a fault; fewer are skipped and counted.
pub(super) const OVERRUN: u64 = 5;

/// So many late wake-ups in a row are too many.
const IN_A_ROW: u32 = 3;

/// So many within [`LATELY`] are too many.
const OFTEN: usize = 10;

/// How far back late wake-ups count.
const LATELY: Duration = Duration::from_secs(1);

/// A clock that differs from another by more has been suspended.
const SUSPENDED: Duration = Duration::from_millis(1);

/// The watch over time itself.
#[derive(Clone, Debug)]
pub(super) struct Lateness {
    period: Duration,
    in_a_row: u32,
    /// When it was late, the last times; the oldest is at `oldest`.
    late: [Option<Instant>; OFTEN],
    oldest: usize,
    /// How long the host has been suspended so far.
    suspended: Duration,
    /// Cycles that took longer than they may.
    overruns: u64,
    /// Torques of this cycle were dropped because they were late.
    has_dropped: bool,
}

impl Lateness {
    /// Never late so far.
    pub(super) const fn new(period: Duration, suspended: Duration) -> Self {
        let late = [None; OFTEN];
        Self { period, in_a_row: 0, late, oldest: 0, suspended, overruns: 0, has_dropped: false }
    }

    /// Returns how many cycles have taken longer than they may: their torques were late, or the turn of the next
    /// SYNC was missed.
    pub(super) const fn overruns(&self) -> u64 {
        self.overruns
    }

    /// Torques of this cycle were too late to be sent. The turn of the next SYNC is missed then, too.
    pub(super) const fn dropped(&mut self) {
        if !self.has_dropped {
            self.overruns += 1;
        }
        self.has_dropped = true;
    }

    /// A cycle begins after `skipped` others were skipped: whether that was too often, or too long.
    pub(super) fn begins(&mut self, now: Instant, skipped: u64) -> Option<Cause> {
        let is_counted = std::mem::take(&mut self.has_dropped);
        if skipped == 0 && !is_counted {
            self.in_a_row = 0;
            return None;
        }
        self.overruns += u64::from(!is_counted);
        self.in_a_row = self.in_a_row.saturating_add(1);
        let slot = self.late.get_mut(self.oldest)?;
        *slot = Some(now);
        self.oldest = (self.oldest + 1) % OFTEN;
        let before = self.late.get(self.oldest).copied().flatten();
        let is_often = before.is_some_and(|before| now.since(before) < LATELY);
        if skipped > OVERRUN {
            Some(Cause::Overrun { cycles: skipped })
        } else {
            (self.in_a_row >= IN_A_ROW || is_often).then_some(Cause::Late)
        }
    }

    /// The samples of the SYNC of `sync_at` are in: whether the loop stood still over them for too long.
    pub(super) fn gathered(&self, sync_at: Instant, now: Instant) -> Option<Cause> {
        let stood = now.since(sync_at).as_micros() / self.period.as_micros().max(1);
        let cycles = u64::try_from(stood).unwrap_or(u64::MAX);
        (cycles > OVERRUN).then_some(Cause::Overrun { cycles })
    }

    /// Whether what is of this moment is too old to act on: more than a period and a half.
    pub(super) fn is_stale(&self, at: Instant, now: Instant) -> bool {
        now.since(at) > self.period + self.period / 2
    }

    /// Whether the host was suspended since it was last asked.
    pub(super) fn resumed(&mut self, suspended: Duration) -> Option<Cause> {
        let before = std::mem::replace(&mut self.suspended, suspended);
        (suspended.saturating_sub(before) > SUSPENDED).then_some(Cause::Suspended)
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

    /// What follows when a cycle begins at each of these, so many skipped before it.
    fn causes(begins: impl IntoIterator<Item = (u64, u64)>) -> Vec<Option<Cause>> {
        let mut lateness = lateness();
        begins.into_iter().map(|(millis, skipped)| lateness.begins(at(millis), skipped)).collect()
    }

    #[test]
    fn hazard_29_three_late_wake_ups_in_a_row_are_too_many_and_two_are_not() {
        assert_eq!(causes([(1, 1), (3, 1), (5, 1)]), [None, None, Some(Cause::Late)]);
        assert_eq!(causes([(1, 1), (3, 1), (4, 0), (6, 1), (8, 1)]), [None; 5]);
    }

    #[test]
    fn hazard_29_ten_late_wake_ups_within_a_second_are_too_many_and_in_more_they_are_not() {
        let apart = |millis: u64| (0..30).flat_map(move |n| [(n * millis, 1), (n * millis + 1, 0)]);
        let first = causes(apart(111)).into_iter().position(|cause| cause.is_some());
        assert_eq!(first, Some(18), "the tenth, 999 ms after the first");
        assert!(causes(apart(112)).iter().all(Option::is_none));
    }

    #[test]
    fn hazard_29_cycles_of_dropped_torques_count_once_as_overruns() {
        let mut lateness = lateness();
        for cycle in 1..=3 {
            assert_eq!(lateness.overruns(), cycle - 1);
            lateness.dropped();
            lateness.dropped();
            assert_eq!(lateness.overruns(), cycle);
            let late = lateness.begins(at(2 * cycle), 1);
            assert_eq!(late, (cycle == 3).then_some(Cause::Late));
        }
        assert_eq!(lateness.begins(at(8), 1), Some(Cause::Late), "without a drop");
        assert_eq!((lateness.begins(at(9), 0), lateness.overruns()), (None, 4));
    }

    #[test]
    fn hazard_29_one_gap_of_more_than_five_periods_is_too_long() {
        assert_eq!(causes([(10, 5)]), [None]);
        assert_eq!(causes([(10, 6)]), [Some(Cause::Overrun { cycles: 6 })]);
        assert_eq!(lateness().gathered(at(10), at(15)), None);
        let cause = Some(Cause::Overrun { cycles: 6 });
        assert_eq!(lateness().gathered(at(10), at(16)), cause);
    }

    #[test]
    fn what_is_older_than_a_period_and_a_half_is_stale() {
        let (sync_at, limit) = (at(10), Instant::from_micros(11_500));
        assert!(!lateness().is_stale(sync_at, limit));
        assert!(lateness().is_stale(sync_at, limit + Duration::from_micros(1)));
    }

    #[test]
    fn hazard_31_a_host_that_was_suspended_is_found_out_once() {
        let mut lateness = lateness();
        let told = [40_000, 40_001, 43_000, 43_000].map(Duration::from_millis);
        let causes = told.map(|suspended| lateness.resumed(suspended));
        assert_eq!(causes, [None, None, Some(Cause::Suspended), None]);
    }
}
