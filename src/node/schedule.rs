//! SYNC schedule on absolute deadlines: lateness does not accumulate, and missed slots are skipped.

use std::time::Duration;

use units::time::Instant;

/// The SYNC schedule.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule {
    period: Duration,
    next: Instant,
}

/// The next SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Due {
    /// Time at which it is due.
    pub(super) at: Instant,
    /// Number of slots skipped since the last SYNC.
    pub(super) skipped: u64,
}

impl Schedule {
    /// Schedules a SYNC every `period`, the first one period after `now`. `period` must not be zero.
    pub(super) fn starting(now: Instant, period: Duration) -> Self {
        Self { period, next: now + period }
    }

    /// Returns whether the SYNC due at `at` is more than half a period late.
    pub(super) fn is_missed(&self, at: Instant, now: Instant) -> bool {
        now > at + self.period / 2
    }

    /// Returns the next SYNC that is at most half a period late. Skips earlier slots; the grid does not move.
    pub(super) fn next(&mut self, now: Instant) -> Due {
        let overdue = now.since(self.next + self.period / 2).as_micros();
        let period = self.period.as_micros().max(1);
        let skipped = u64::try_from(overdue.div_ceil(period)).unwrap_or(u64::MAX);
        let at = self.next + self.period * u32::try_from(skipped).unwrap_or(u32::MAX);
        self.next = at + self.period;
        Due { at, skipped }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(1);

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    #[test]
    fn late_cycle_does_not_move_the_grid() {
        let mut schedule = Schedule::starting(at(0), PERIOD);
        assert_eq!(schedule.next(at(0)), Due { at: at(1_000), skipped: 0 });
        assert_eq!(schedule.next(at(2_300)), Due { at: at(2_000), skipped: 0 });
        assert_eq!(schedule.next(at(2_310)), Due { at: at(3_000), skipped: 0 });
    }

    #[test]
    fn missed_slots_are_skipped() {
        let mut schedule = Schedule::starting(at(0), PERIOD);
        assert_eq!(schedule.next(at(7_400)), Due { at: at(7_000), skipped: 6 });
        assert_eq!(schedule.next(at(7_450)), Due { at: at(8_000), skipped: 0 });
    }
}
