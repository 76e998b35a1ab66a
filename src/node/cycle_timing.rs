//! Times of the cycle: period, SYNC schedule, SYNC window and lateness. Callers pass the time of the bus's clock.

use std::time::Duration;

use crate::cause::Cause;
use crate::cycle_times::Readings;
use crate::lateness::{self, Lateness};
use crate::sample_times::SampleTimes;
use crate::schedule::Schedule;
use config::Config;
use units::time::Instant;

/// Period, window and schedule of SYNC, and lateness of the loop.
#[derive(Clone, Debug)]
pub(super) struct CycleTiming {
    pub(super) period: Duration,
    /// Maximum time from a SYNC to its first TPDO.
    window: Duration,
    /// Maximum time from a TPDO to the next one.
    next_answer: Duration,
    pub(super) sample_times: SampleTimes,
    /// Maximum number of frames to read after the end of a wait.
    pub(super) max_late_frames: u64,
    pub(super) schedule: Schedule,
    pub(super) lateness: Lateness,
    /// Clock readings of the current cycle.
    pub(super) readings: Readings,
    /// Number of completed cycles.
    pub(super) cycle: u64,
    /// Set if no cycle was completed since the last [`restart`](Self::restart).
    is_restarted: bool,
}

impl CycleTiming {
    /// Schedules the first SYNC one period after `now`. `suspended` is the time of host suspension so far.
    pub(super) fn new(config: &Config, now: Instant, suspended: Duration) -> Self {
        Self {
            period: config.period,
            window: config.window(),
            next_answer: config.longest_frame(),
            sample_times: SampleTimes::new(config.joints.each_ref().map(|joint| joint.channel)),
            max_late_frames: config.most_frames(lateness::MAX_SKIPPED_CYCLES + 1),
            schedule: Schedule::starting(now, config.period),
            lateness: Lateness::new(config.period, suspended),
            readings: Readings::default(),
            cycle: 0,
            is_restarted: true,
        }
    }

    /// Restarts the schedule: the next SYNC is due one period after `now`, and its samples follow a gap.
    pub(super) fn restart(&mut self, now: Instant) {
        self.schedule = Schedule::starting(now, self.period);
        self.is_restarted = true;
    }

    /// Returns whether the samples of a cycle follow a gap: it skips SYNC slots, or is the first after a restart.
    pub(super) const fn follows_gap(&self, skipped: u64) -> bool {
        skipped > 0 || self.is_restarted
    }

    /// Counts a completed cycle.
    pub(super) const fn end_cycle(&mut self) {
        self.cycle += 1;
        self.is_restarted = false;
    }

    /// Returns the end of the window of the SYNC sent at `sync_at`, whose latest TPDO was received at `answered`.
    pub(super) fn window_end(&self, sync_at: Instant, answered: Option<Instant>) -> Instant {
        let first = sync_at + self.window;
        let until = answered.map_or(first, |at| first.max(at + self.next_answer));
        until.min(sync_at + self.period)
    }

    /// Returns the time until which the samples of the SYNC sent at `sync_at` are not read, at most the end of its window.
    pub(super) fn read_from(&self, sync_at: Instant) -> Instant {
        self.sample_times.read_from(sync_at).min(self.window_end(sync_at, None))
    }

    /// Returns whether the slot of a SYNC is over.
    pub(super) fn is_missed(&self, due: Instant, now: Instant) -> bool {
        self.schedule.is_missed(due, now)
    }

    /// Returns the causes at the start of a cycle after `skipped` SYNC slots: host suspended, late.
    pub(super) fn watch_start(
        &mut self,
        now: Instant,
        suspended: Duration,
        skipped: u64,
    ) -> [Option<Cause>; 2] {
        let resumed = self.lateness.watch_suspension(suspended);
        let is_first = self.cycle == 0;
        let late = if is_first { None } else { self.lateness.start_cycle(now, skipped) };
        [resumed, late]
    }

    /// Returns the causes if the loop stalled from `due` to `now`: host suspended, stall.
    pub(super) fn watch_stall(
        &mut self,
        due: Instant,
        now: Instant,
        suspended: Duration,
    ) -> [Option<Cause>; 2] {
        [self.lateness.watch_suspension(suspended), self.lateness.watch_stall(due, now)]
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn tpdos_extend_the_window_but_not_past_the_next_sync() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let timing = CycleTiming::new(&config, Instant::ZERO, Duration::ZERO);
        let sync_at = Instant::from_micros(5_000);
        let first = timing.window_end(sync_at, None);
        assert_eq!(first, sync_at + config.window());
        assert_eq!(timing.window_end(sync_at, Some(sync_at)), first, "an early TPDO");
        let extended = timing.window_end(sync_at, Some(first));
        assert_eq!(extended, first + config.longest_frame());
        let next_sync = sync_at + config.period;
        assert!(extended < next_sync);
        assert_eq!(timing.window_end(sync_at, Some(next_sync)), next_sync);
    }
}
