//! Overdue samples of one joint: empty SYNC windows, less second and further responses of a window.
//!
//! A queue that grows between drive and node leaves windows empty; every later sample is as many cycles old. A lost
//! sample leaves an empty window, too. The count therefore decays, so that a loss rate of 0.1 % never adds up.
//! A delay that grows more slowly escapes this count. The total without decay keeps it: the responses that arrive
//! when the delay ends do not come from a second node.

use std::time::Duration;

use units::time::Instant;

/// Maximum overdue samples.
const MAX_OVERDUE: u32 = 10;

/// Cycles in which the count decays by one.
const DECAY_CYCLES: u32 = 250;

/// Time without an empty window after which the total is cleared.
const TOTAL_CLEAR_TIME: Duration = Duration::from_secs(10);

/// Counts of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overdue {
    count: u32,
    /// Cycles since the count last decayed.
    cycles: u32,
    /// Overdue samples without decay.
    total: u32,
    /// End of the last empty window.
    last_empty_at: Instant,
}

impl Overdue {
    /// Returns counts of zero.
    pub(super) const fn new() -> Self {
        Self { count: 0, cycles: 0, total: 0, last_empty_at: Instant::ZERO }
    }

    /// Ends a SYNC window at `now`.
    pub(super) fn end_window(&mut self, now: Instant, has_response: bool) {
        self.cycles += 1;
        if self.cycles >= DECAY_CYCLES {
            self.cycles = 0;
            self.count = self.count.saturating_sub(1);
        }
        if !has_response {
            self.count = self.count.saturating_add(1);
            self.total = self.total.saturating_add(1);
            self.last_empty_at = now;
        } else if now.since(self.last_empty_at) > TOTAL_CLEAR_TIME {
            self.total = 0;
        }
    }

    /// Takes a response behind the first of its window: one sample less is overdue.
    pub(super) const fn on_further_response(&mut self) {
        self.count = self.count.saturating_sub(1);
        self.total = self.total.saturating_sub(1);
    }

    /// Returns the overdue samples after decay. Received samples may be as many cycles old.
    pub(super) const fn count(&self) -> u32 {
        self.count
    }

    /// Returns the overdue samples without decay.
    pub(super) const fn total(&self) -> u32 {
        self.total
    }

    /// Returns the overdue samples if they exceed their maximum.
    pub(super) const fn excess(&self) -> Option<u32> {
        if self.count > MAX_OVERDUE { Some(self.count) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns the window of 1 ms in which the count exceeds its maximum. `is_empty` selects the empty windows, from 1.
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
    fn further_responses_compensate_empty_windows() {
        let mut overdue = Overdue::new();
        for window in 0..1_000 {
            overdue.end_window(Instant::from_micros(1_000 * window), window % 4 != 0);
            if window % 4 == 1 {
                overdue.on_further_response();
            }
            assert!(overdue.count() <= 1 && overdue.excess().is_none());
        }
    }

    #[test]
    fn total_stays_until_10_s_without_an_empty_window() {
        let mut overdue = Overdue::new();
        let mut windows = 0..;
        let mut pass = |overdue: &mut Overdue, count: usize, has_response| {
            for window in windows.by_ref().take(count) {
                overdue.end_window(Instant::from_micros(1_000 * window), has_response);
            }
            (overdue.count(), overdue.total())
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
