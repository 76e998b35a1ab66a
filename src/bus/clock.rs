//! Clocks of the host. No other file of the rack reads them.

use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

/// Maximum time between two readings that count as simultaneous.
const MAX_SPREAD: Duration = Duration::from_micros(20);

/// Maximum attempts to read both clocks at once.
const MAX_ATTEMPTS: usize = 4;

/// Simultaneous reading of both clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    /// Monotonic time since boot, without suspension.
    pub(super) monotonic: Duration,
    /// Wall clock: time since 1970, UTC.
    pub(super) wall: Duration,
}

impl Reading {
    /// Reads both clocks.
    pub(super) fn now() -> Self {
        let mut reading = Self::tried();
        for _ in 1..MAX_ATTEMPTS {
            if reading.1 <= MAX_SPREAD {
                break;
            }
            reading = Self::tried();
        }
        reading.0
    }

    /// Reads both clocks once, and returns the time it took.
    fn tried() -> (Self, Duration) {
        let (before, wall, after) = (monotonic(), wall(), monotonic());
        (Self { monotonic: after, wall }, after.saturating_sub(before))
    }

    /// Converts the wall-clock time `stamp` to monotonic time, if no clock was set in between; `None` before boot.
    pub(super) fn monotonic_of(&self, stamp: Duration) -> Option<Duration> {
        (self.monotonic + stamp).checked_sub(self.wall)
    }
}

/// Returns the monotonic time since boot, without suspension.
pub fn monotonic() -> Duration {
    read(ClockId::CLOCK_MONOTONIC)
}

/// Returns the wall clock: time since 1970, UTC.
pub(super) fn wall() -> Duration {
    read(ClockId::CLOCK_REALTIME)
}

/// Returns the total time suspended since boot, or slightly less.
pub(super) fn suspended() -> Duration {
    // In this order a delay between the readings makes the result smaller, never larger.
    let since_start = read(ClockId::CLOCK_BOOTTIME);
    since_start.saturating_sub(monotonic())
}

/// Waits until [`monotonic`] reaches `until`.
pub fn wait(until: Duration) {
    let until = TimeSpec::from_duration(until);
    let absolute = ClockNanosleepFlags::TIMER_ABSTIME;
    while clock_nanosleep(ClockId::CLOCK_MONOTONIC, absolute, &until).is_err() {
        // Interrupted by a signal.
    }
}

/// Reads a clock; every Linux kernel has it.
fn read(id: ClockId) -> Duration {
    clock_gettime(id).map(Duration::from).unwrap_or_default()
}
