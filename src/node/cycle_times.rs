//! Times of the steps of a cycle, from clock readings and frame stamps that the cycle takes anyway.

use std::time::Duration;

use units::time::Instant;

/// Times of the steps of one cycle. Resolution: 1 µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleTimes {
    /// From the last target of the previous cycle to the wait for SYNC: services, record, requests.
    pub rest: Duration,
    /// From the time at which SYNC was due to the wake-up.
    pub wake_up: Duration,
    /// From SYNC to the sample of each joint; `None` for a missing sample.
    pub samples: [Option<Duration>; 6],
    /// From SYNC to the end of its window.
    pub window: Duration,
    /// From there to the first target: watches and controller.
    pub step: Duration,
    /// From SYNC to the last target accepted by its bus.
    pub targets: Duration,
    /// From SYNC to its transmit confirmation, the latest of all buses; `None` without a confirmation.
    pub confirmed: Option<Duration>,
}

/// Clock readings of the current cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Readings {
    /// Start of the wait for SYNC, due time of SYNC, and wake-up.
    pub(super) wait_from: Instant,
    pub(super) due: Instant,
    pub(super) woken: Instant,
    /// After the last TPDO in the SYNC window, or at its end.
    pub(super) window_end: Instant,
    /// Before the first target, and after the last.
    pub(super) first_target: Option<Instant>,
    pub(super) last_target: Instant,
    /// After the last target of the previous cycle.
    before: Instant,
}

impl Readings {
    /// Starts a cycle: its wait for SYNC begins at `now`.
    pub(super) fn start(&mut self, now: Instant) {
        *self = Self { wait_from: now, before: self.last_target, ..Self::default() };
    }

    /// Records a reading before a target, or after the last one.
    pub(super) fn on_target(&mut self, now: Instant) {
        self.first_target.get_or_insert(now);
        self.last_target = now;
    }

    /// Returns the times of a cycle whose SYNC was sent at `sync_at`, with the times of samples and confirmation.
    pub(super) fn times(
        &self,
        sync_at: Instant,
        samples: [Option<Instant>; 6],
        confirmed: Option<Instant>,
    ) -> CycleTimes {
        let first_target = self.first_target.unwrap_or(self.window_end);
        CycleTimes {
            rest: self.wait_from.since(self.before),
            wake_up: self.woken.since(self.due),
            samples: samples.map(|at| at.map(|at| at.since(sync_at))),
            window: self.window_end.since(sync_at),
            step: first_target.since(self.window_end),
            targets: self.last_target.since(sync_at),
            confirmed: confirmed.map(|at| at.since(sync_at)),
        }
    }
}
