//! Times of the cycle: its period, when the next SYNC is due, how long samples are waited for, and whether the
//! loop keeps up. It reads no clock; the bus does.

use std::time::Duration;

use crate::cause::Cause;
use crate::lateness;
use crate::lateness::Lateness;
use crate::schedule::Due;
use crate::schedule::Schedule;
use config::Config;
use units::time::Instant;

/// Times of the cycle.
#[derive(Clone, Debug)]
pub(super) struct CycleTiming {
    pub(super) period: Duration,
    /// Time after a SYNC in which its first TPDO is awaited.
    window: Duration,
    /// Time after a TPDO in which the next one is awaited.
    next_answer: Duration,
    /// Maximum number of frames to read after a wait has ended.
    pub(super) max_late_frames: u64,
    pub(super) schedule: Schedule,
    pub(super) lateness: Lateness,
    /// Number of the last cycle that ended, from 1.
    pub(super) cycle: u64,
}

impl CycleTiming {
    /// First SYNC one period after `now`. `suspended` is how long the host has been suspended so far.
    pub(super) fn new(config: &Config, now: Instant, suspended: Duration) -> Self {
        Self {
            period: config.period,
            window: config.window(),
            next_answer: config.longest_frame(),
            max_late_frames: config.most_frames(lateness::OVERRUN + 1),
            schedule: Schedule::starting(now, config.period),
            lateness: Lateness::new(config.period, suspended),
            cycle: 0,
        }
    }

    /// Starts the schedule again: the next SYNC is due one period after `now`.
    pub(super) fn restart(&mut self, now: Instant) {
        self.schedule = Schedule::starting(now, self.period);
    }

    /// End of the window of the SYNC of `sync_at` after the last of its TPDOs came at `answered`.
    pub(super) fn window_end(&self, sync_at: Instant, answered: Option<Instant>) -> Instant {
        let first = sync_at + self.window;
        let until = answered.map_or(first, |at| first.max(at + self.next_answer));
        until.min(sync_at + self.period)
    }

    /// Returns whether it is too late to send the SYNC that was due at `due`.
    pub(super) fn is_missed(&self, due: Due, now: Instant) -> bool {
        self.schedule.is_missed(due.at, now)
    }

    /// Causes at the start of a cycle, `skipped` SYNCs after the one before.
    pub(super) fn watch_start(
        &mut self,
        now: Instant,
        suspended: Duration,
        skipped: u64,
    ) -> [Option<Cause>; 2] {
        let resumed = self.lateness.resumed(suspended);
        let is_first = self.cycle == 0;
        let late = if is_first { None } else { self.lateness.begins(now, skipped) };
        [resumed, late]
    }

    /// Causes if the loop stood still from `due` until `now`.
    pub(super) fn watch_standstill(
        &mut self,
        due: Instant,
        now: Instant,
        suspended: Duration,
    ) -> [Option<Cause>; 2] {
        [self.lateness.resumed(suspended), self.lateness.gathered(due, now)]
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
