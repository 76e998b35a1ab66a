//! The clocks of this machine, read nowhere else.

use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::time::ClockId;
use nix::time::ClockNanosleepFlags;
use nix::time::clock_gettime;
use nix::time::clock_nanosleep;

/// Two clocks read within this time count as read at once.
const AT_ONCE: Duration = Duration::from_micros(20);

/// So often it is tried to read them at once.
const TRIES: usize = 4;

/// Two clocks, read at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    /// Time since the machine started, without what it was suspended for; no hand sets it.
    pub(super) monotonic: Duration,
    /// Time since 1970.
    pub(super) wall: Duration,
}

impl Reading {
    /// Both clocks now.
    pub(super) fn now() -> Self {
        let mut reading = Self::tried();
        for _ in 1..TRIES {
            if reading.1 <= AT_ONCE {
                break;
            }
            reading = Self::tried();
        }
        reading.0
    }

    /// Both clocks, and within what time they were read.
    fn tried() -> (Self, Duration) {
        let (before, wall, after) = (monotonic(), wall(), monotonic());
        (Self { monotonic: after, wall }, after.saturating_sub(before))
    }

    /// What the monotonic clock showed when the one on the wall showed `stamp`, if neither was set
    /// between then and this reading; `None` before the machine started.
    pub(super) fn monotonic_of(&self, stamp: Duration) -> Option<Duration> {
        (self.monotonic + stamp).checked_sub(self.wall)
    }
}

/// Time since the machine started, without what it was suspended for; no hand sets it.
pub(super) fn monotonic() -> Duration {
    read(ClockId::CLOCK_MONOTONIC)
}

/// Time since 1970.
pub(super) fn wall() -> Duration {
    read(ClockId::CLOCK_REALTIME)
}

/// How long the machine has been suspended since it started, or a moment less.
pub(super) fn suspended() -> Duration {
    // In this order a delay between the two makes it less, never more.
    let since_start = read(ClockId::CLOCK_BOOTTIME);
    since_start.saturating_sub(monotonic())
}

/// Waits until [`monotonic`] shows `until`.
pub(super) fn wait(until: Duration) {
    let until = TimeSpec::from_duration(until);
    let absolute = ClockNanosleepFlags::TIMER_ABSTIME;
    while clock_nanosleep(ClockId::CLOCK_MONOTONIC, absolute, &until).is_err() {
        // A signal came first.
    }
}

/// That a Linux kernel has these clocks is not in doubt.
fn read(id: ClockId) -> Duration {
    clock_gettime(id).map(Duration::from).unwrap_or_default()
}
