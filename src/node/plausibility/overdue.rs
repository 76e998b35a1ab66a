//! Samples of one joint that are overdue: windows without an answer, less answers behind the first of a window.
//!
//! A queue that grows between drive and node leaves windows empty and never makes them good: every sample behind them
//! is as many cycles old. A sample that is lost looks the same, so one is forgiven after so many cycles that one loss
//! in a thousand never adds up. A delay that grows more slowly is not seen here, but remembered for a while: when it
//! ends, its samples are not those of a second node.

use std::time::Duration;

use units::time::Instant;

/// Maximum samples overdue.
const MAX_OVERDUE: u32 = 10;

/// Cycles after which one is forgiven.
const FORGIVEN_EVERY: u32 = 250;

/// Time without an empty window after which none is remembered.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(10);

/// The count of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overdue {
    count: u32,
    /// Cycles since one was forgiven.
    cycles: u32,
    /// The same count without forgiveness.
    remembered: u32,
    emptied_at: Instant,
}

impl Overdue {
    /// Nothing is overdue.
    pub(super) const fn new() -> Self {
        Self { count: 0, cycles: 0, remembered: 0, emptied_at: Instant::ZERO }
    }

    /// Takes a window that is over at `now`.
    pub(super) fn end_window(&mut self, now: Instant, is_answered: bool) {
        self.cycles += 1;
        if self.cycles >= FORGIVEN_EVERY {
            self.cycles = 0;
            self.count = self.count.saturating_sub(1);
        }
        if !is_answered {
            self.count = self.count.saturating_add(1);
            self.remembered = self.remembered.saturating_add(1);
            self.emptied_at = now;
        } else if now.since(self.emptied_at) > FORGOTTEN_AFTER {
            self.remembered = 0;
        }
    }

    /// Takes an answer that makes one good.
    pub(super) const fn make_good(&mut self) {
        self.count = self.count.saturating_sub(1);
        self.remembered = self.remembered.saturating_sub(1);
    }

    /// Returns how many are overdue, lately forgiven ones left out: the samples that come may be as many cycles old.
    pub(super) const fn count(&self) -> u32 {
        self.count
    }

    /// Returns how many are overdue, forgiven ones included.
    pub(super) const fn remembered(&self) -> u32 {
        self.remembered
    }

    /// Returns how many are overdue if they are too many.
    pub(super) const fn excess(&self) -> Option<u32> {
        if self.count > MAX_OVERDUE { Some(self.count) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// After how many windows of a millisecond they are too many, if the `n`th is empty as `is_empty` says.
    fn exceeded(windows: u32, is_empty: impl Fn(u32) -> bool) -> Option<u32> {
        let mut overdue = Overdue::new();
        (1..=windows).find(|window| {
            let now = Instant::from_micros(1_000 * u64::from(*window));
            overdue.end_window(now, !is_empty(*window));
            overdue.excess().is_some()
        })
    }

    #[test]
    fn hazard_04_delay_growing_every_50_ms_is_seen_at_14_cycles() {
        assert_eq!(exceeded(2_000, |window| window.is_multiple_of(50)), Some(13 * 50));
        assert_eq!(exceeded(2_000, |window| window.is_multiple_of(20)), Some(11 * 20));
    }

    #[test]
    fn answers_behind_the_first_make_it_good() {
        let mut overdue = Overdue::new();
        for window in 0..1_000 {
            overdue.end_window(Instant::from_micros(1_000 * window), window % 4 != 0);
            if window % 4 == 1 {
                overdue.make_good();
            }
            assert!(overdue.count() <= 1 && overdue.excess().is_none());
        }
    }

    #[test]
    fn slow_delay_is_remembered_until_ten_seconds_without_an_empty_window() {
        let mut overdue = Overdue::new();
        let mut windows = 0..;
        let mut pass = |overdue: &mut Overdue, count: usize, is_answered| {
            for window in windows.by_ref().take(count) {
                overdue.end_window(Instant::from_micros(1_000 * window), is_answered);
            }
            (overdue.count(), overdue.remembered())
        };
        for grown in 1..=5 {
            assert_eq!(pass(&mut overdue, 1, false).1, grown);
            pass(&mut overdue, 999, true);
        }
        assert_eq!(pass(&mut overdue, 1, true), (0, 5));
        assert_eq!(pass(&mut overdue, 9_999, true), (0, 0));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn promise_14_one_loss_in_a_thousand_is_never_overdue(
            lost in prop::collection::vec(prop::bool::weighted(0.001), 20_000)
        ) {
            let is_lost = |window| lost[usize::try_from(window).unwrap() - 1];
            prop_assert_eq!(exceeded(20_000, is_lost), None);
        }
    }
}
