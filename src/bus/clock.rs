//! Clocks of the host. No other file of the rack reads them.

use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

/// Maximum time between two readings that count as simultaneous, and change between the clocks that is no step.
const MAX_SPREAD: Duration = Duration::from_micros(20);

/// Maximum attempts to read both clocks at once.
const MAX_ATTEMPTS: usize = 4;

/// Simultaneous reading of both clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    /// Time since boot, suspension included.
    pub(super) boot: Duration,
    /// Wall clock: time since 1970, UTC.
    pub(super) wall: Duration,
}

impl Reading {
    /// Reads both clocks again, once if they still differ by as much. Otherwise one was set, or the process was stopped
    /// between the readings.
    pub(super) fn again(self) -> Self {
        let (boot, wall) = (boot(), wall());
        let reading = Self { boot, wall };
        if reading.agrees(self) { reading } else { Self::now() }
    }

    /// Returns whether the clocks differ by as much in both readings.
    pub(super) fn agrees(self, other: Self) -> bool {
        let (this, that) = (self.wall + other.boot, other.wall + self.boot);
        this.abs_diff(that) <= MAX_SPREAD
    }

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
        let (before, wall, after) = (boot(), wall(), boot());
        // The earlier of the two: a frame is rather dated too old.
        (Self { boot: before, wall }, after.saturating_sub(before))
    }

    /// Converts the wall-clock time `stamp` to time since boot, if no clock was set in between; `None` before boot.
    pub(super) fn boot_of(&self, stamp: Duration) -> Option<Duration> {
        (self.boot + stamp).checked_sub(self.wall)
    }
}

/// Returns the monotonic time since boot, without suspension.
pub fn monotonic() -> Duration {
    read(ClockId::CLOCK_MONOTONIC)
}

/// Returns the time since boot, suspension included: what lies before a suspension is old after it.
pub(super) fn boot() -> Duration {
    read(ClockId::CLOCK_BOOTTIME)
}

/// Returns the wall clock: time since 1970, UTC.
pub(super) fn wall() -> Duration {
    read(ClockId::CLOCK_REALTIME)
}

/// Returns the total time suspended since boot, or slightly less.
pub(super) fn suspended() -> Duration {
    // In this order a delay between the readings makes the result smaller, never larger.
    let since_boot = boot();
    since_boot.saturating_sub(monotonic())
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
