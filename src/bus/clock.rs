//! Clocks of the host. No other file of the rack reads them.

use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

use units::time::Instant;

/// Maximum time between two simultaneous readings, and maximum change between the clocks without a step, in ns.
const MAX_SPREAD: u64 = 20_000;

/// Maximum attempts to read both clocks at once.
const MAX_ATTEMPTS: usize = 4;

/// Simultaneous reading of both clocks, in ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    /// Time since boot, suspension included.
    pub(super) boot: u64,
    /// Wall clock: time since 1970, UTC.
    pub(super) wall: u64,
}

impl Reading {
    /// Reads both clocks again, once if they still differ by as much. Otherwise one was set, or the process was stopped
    /// between the readings.
    pub(super) fn again(self) -> Self {
        let (boot, wall) = (boot(), nanos(ClockId::CLOCK_REALTIME));
        let reading = Self { boot, wall };
        if reading.agrees(self) { reading } else { Self::now() }
    }

    /// Returns whether the clocks differ by as much in both readings.
    pub(super) fn agrees(self, other: Self) -> bool {
        let (this, that) = (self.wall.wrapping_sub(self.boot), other.wall.wrapping_sub(other.boot));
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
    fn tried() -> (Self, u64) {
        let (before, wall, after) = (boot(), nanos(ClockId::CLOCK_REALTIME), boot());
        // The earlier of the two, because a frame should rather be dated too old.
        (Self { boot: before, wall }, after.saturating_sub(before))
    }

    /// Converts the wall-clock time `stamp` to time since boot, if no clock was set in between; `None` before boot.
    pub(super) const fn boot_of(self, stamp: u64) -> Option<u64> {
        self.boot.saturating_add(stamp).checked_sub(self.wall)
    }
}

/// Returns the monotonic time since boot, without suspension.
pub fn monotonic() -> Duration {
    read(ClockId::CLOCK_MONOTONIC)
}

/// Returns the time since boot in ns, including suspension, so that data from before a suspension is old.
pub(super) fn boot() -> u64 {
    nanos(ClockId::CLOCK_BOOTTIME)
}

/// Returns the wall clock: time since 1970, UTC.
pub(super) fn wall() -> Duration {
    read(ClockId::CLOCK_REALTIME)
}

/// Returns the total time suspended since boot, or slightly less.
pub(super) fn suspended() -> Duration {
    // In this order a delay between the readings makes the result smaller, never larger.
    let since_boot = boot();
    Duration::from_nanos(since_boot.saturating_sub(nanos(ClockId::CLOCK_MONOTONIC)))
}

/// Waits until [`monotonic`] reaches `until`.
pub fn wait(until: Duration) {
    let until = TimeSpec::from_duration(until);
    let absolute = ClockNanosleepFlags::TIMER_ABSTIME;
    while clock_nanosleep(ClockId::CLOCK_MONOTONIC, absolute, &until).is_err() {
        // Interrupted by a signal.
    }
}

/// Returns the time on the bus of a time since boot, both in ns.
pub(super) const fn instant(boot: u64, opened: u64) -> Instant {
    Instant::from_micros(boot.saturating_sub(opened) / 1_000)
}

/// Reads a clock; every Linux kernel has it.
fn read(id: ClockId) -> Duration {
    Duration::from_nanos(nanos(id))
}

/// Reads a clock, in ns: until the year 2554.
fn nanos(id: ClockId) -> u64 {
    clock_gettime(id).map(nanos_of).unwrap_or_default()
}

/// Returns a time of the kernel in ns.
pub(super) fn nanos_of(time: TimeSpec) -> u64 {
    let (seconds, nanos) = (u64::try_from(time.tv_sec()), u64::try_from(time.tv_nsec()));
    seconds.unwrap_or(0).saturating_mul(1_000_000_000).saturating_add(nanos.unwrap_or(0))
}
