//! How often the node asks its nodes something by SDO while it runs: as often as their bus was planned for.
//!
//! On a bus that its cycle nearly fills, a request in each of them is more than it carries: the node's next
//! SYNC waits behind it, each a bit longer, and those that follow come too soon after each other. While the
//! network comes up there is no torque, and nobody waits for a SYNC in time.

use std::time::Duration;

use canopen::load::network::Assumptions;
use units::time::Instant;

/// When the next request may go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asking {
    gap: Duration,
    next: Instant,
}

impl Asking {
    /// Nothing was asked yet.
    pub(super) fn new() -> Self {
        let gap = Assumptions::default().sdo_gap_us;
        Self { gap: Duration::from_micros(gap.into()), next: Instant::ZERO }
    }

    /// Whether a request may go now.
    pub(super) fn may(&self, now: Instant) -> bool {
        now >= self.next
    }

    /// A request goes.
    pub(super) fn asked(&mut self, now: Instant) {
        self.next = now + self.gap;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_request_goes_at_once_and_the_next_ones_every_ten_milliseconds() {
        let mut asking = Asking::new();
        let goes = |millis: &u64| {
            let now = Instant::from_micros(1_000 * millis);
            let may = asking.may(now);
            if may {
                asking.asked(now);
            }
            may
        };
        let gone: Vec<u64> = (7..60).filter(goes).collect();
        assert_eq!(gone, [7, 17, 27, 37, 47, 57]);
    }
}
