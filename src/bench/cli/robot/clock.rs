//! Time of the far side, and its periods.
//!
//! The clock includes suspensions of the host, so that a command from before one is stale.

use std::time::Duration;

use nix::errno::Errno;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

use units::time::Instant;

/// Clock that is never set and includes suspensions of the host.
const CLOCK: ClockId = ClockId::CLOCK_BOOTTIME;

/// Time since the start of this process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    start: Duration,
}

impl Clock {
    /// Starts at zero.
    pub(super) fn start() -> Self {
        Self { start: read() }
    }

    /// Returns the time.
    pub(super) fn now(self) -> Instant {
        Instant::ZERO + read().saturating_sub(self.start)
    }

    /// Sleeps until this time of the clock.
    pub(super) fn wait(self, until: Instant) {
        let until = TimeSpec::from_duration(self.start + until.since(Instant::ZERO));
        let absolute = ClockNanosleepFlags::TIMER_ABSTIME;
        while clock_nanosleep(CLOCK, absolute, &until) == Err(Errno::EINTR) {}
    }
}

/// Reads the clock, which every supported Linux kernel has.
fn read() -> Duration {
    clock_gettime(CLOCK).map(Duration::from).unwrap_or_default()
}

/// Returns the start of the cycle after the one at `due`. Missed cycles are skipped.
pub(super) fn next_due(due: Instant, now: Instant, period: Duration) -> Instant {
    let next = due + period;
    if next > now { next } else { now + period }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_keep_their_grid_and_leave_out_what_they_missed() {
        let at = |micros| Instant::from_micros(micros);
        let period = Duration::from_millis(1);
        assert_eq!(next_due(at(5_000), at(5_400), period), at(6_000));
        assert_eq!(next_due(at(5_000), at(5_999), period), at(6_000));
        assert_eq!(next_due(at(5_000), at(6_000), period), at(7_000));
        assert_eq!(next_due(at(5_000), at(3_005_000), period), at(3_006_000));
    }

    #[test]
    fn clock_reaches_the_time_that_is_waited_for() {
        let clock = Clock::start();
        let until = clock.now() + Duration::from_millis(2);
        clock.wait(until);
        assert!(clock.now() >= until);
    }
}
