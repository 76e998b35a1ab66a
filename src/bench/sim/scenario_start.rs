//! Time zero of a scenario: the first SYNC, or a later one after a pause before any torque. A master with a proof test
//! pauses SYNC before it is ready; the times of the script start afterwards.

use std::time::Duration;

use units::time::Instant;

/// Time zero of a scenario.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ScenarioStart {
    zero: Option<Instant>,
    last: Option<Instant>,
    /// Time between the last two SYNCs.
    gap: Option<Duration>,
    is_final: bool,
}

impl ScenarioStart {
    /// Returns time zero, after the first SYNC.
    pub(super) const fn zero(&self) -> Option<Instant> {
        self.zero
    }

    /// Handles a SYNC; returns whether the scenario starts with it.
    pub(super) fn on_sync(&mut self, now: Instant) -> bool {
        let gap = self.last.map(|last| now.since(last));
        let is_after_pause =
            gap.zip(self.gap).is_some_and(|(gap, before)| gap > before * MIN_PAUSE_PERIODS);
        self.last = Some(now);
        self.gap = gap;
        let starts = self.zero.is_none() || is_after_pause && !self.is_final;
        if starts {
            self.zero = Some(now);
            self.gap = None;
        }
        starts
    }

    /// Fixes time zero, if it is set: a drive has torque, or the script has acted.
    pub(super) const fn fix(&mut self) {
        self.is_final = self.zero.is_some();
    }
}

/// SYNC periods without a SYNC that count as a pause.
const MIN_PAUSE_PERIODS: u32 = 3;

#[cfg(test)]
mod tests {
    use super::*;

    fn zero(start: &mut ScenarioStart, syncs: impl IntoIterator<Item = u64>) -> u64 {
        syncs.into_iter().for_each(|at| {
            start.on_sync(Instant::from_micros(at));
        });
        start.zero().unwrap().as_micros()
    }

    #[test]
    fn scenario_restarts_after_a_pause_until_fixed() {
        let mut start = ScenarioStart::default();
        start.fix();
        assert_eq!(zero(&mut start, [1_000, 2_000, 3_000, 5_500, 6_500]), 1_000, "jitter");
        assert_eq!(zero(&mut start, [14_000, 15_000, 16_000]), 14_000);
        start.fix();
        assert_eq!(zero(&mut start, [50_000, 51_000]), 14_000);
    }

    #[test]
    fn slow_sync_is_not_a_pause() {
        let syncs = (1..50).map(|place| place * 100_000);
        assert_eq!(zero(&mut ScenarioStart::default(), syncs), 100_000);
    }
}
