//! Clock of this process, which is never set and continues while the host is suspended.

use std::time::Duration;

use nix::time::{ClockId, clock_gettime};
use units::time::Instant;

/// Returns the time since the host started.
pub(crate) fn now() -> Instant {
    // Every Linux kernel has this clock.
    let since = clock_gettime(ClockId::CLOCK_BOOTTIME).map(Duration::from).unwrap_or_default();
    Instant::ZERO + since
}
