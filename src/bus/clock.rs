//! The two clocks of this machine, read nowhere else.

use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::time::ClockId;
use nix::time::ClockNanosleepFlags;
use nix::time::clock_gettime;
use nix::time::clock_nanosleep;

/// Time since the machine started; no hand sets it.
pub(super) fn monotonic() -> Duration {
    read(ClockId::CLOCK_MONOTONIC)
}

/// Time since 1970.
pub(super) fn wall() -> Duration {
    read(ClockId::CLOCK_REALTIME)
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
