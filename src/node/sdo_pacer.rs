//! Pace of SDO requests while the node runs: no more of them than the bus load was planned for.
//!
//! On a bus that its cycle nearly fills, a request in each of them is more than it carries: the node's next
//! SYNC waits behind it, each a bit longer, and those that follow come too soon after each other. While the
//! network comes up there is no torque, and nobody waits for a SYNC in time.

use std::time::Duration;

use canopen::load::network::Assumptions;
use units::time::Instant;

/// Time from which the next request may be sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct SdoPacer {
    gap: Duration,
    next: Instant,
}

impl SdoPacer {
    /// Nothing was requested yet.
    pub(super) fn new() -> Self {
        let gap = Assumptions::default().sdo_gap_us;
        Self { gap: Duration::from_micros(gap.into()), next: Instant::ZERO }
    }

    /// Returns whether a request may be sent now.
    pub(super) fn may_send(&self, now: Instant) -> bool {
        now >= self.next
    }

    /// Takes that a request is sent.
    pub(super) fn on_sent(&mut self, now: Instant) {
        self.next = now + self.gap;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_request_goes_at_once_and_the_next_every_10_ms() {
        let mut pacer = SdoPacer::new();
        let goes = |millis: &u64| {
            let now = Instant::from_micros(1_000 * millis);
            let may = pacer.may_send(now);
            if may {
                pacer.on_sent(now);
            }
            may
        };
        let gone: Vec<u64> = (7..60).filter(goes).collect();
        assert_eq!(gone, [7, 17, 27, 37, 47, 57]);
    }
}
