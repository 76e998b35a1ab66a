//! Limits the rate of SDO requests while the node runs to that assumed in the bus load.
//!
//! On a nearly full bus one request per cycle would delay each SYNC a bit more, and shorten the period that follows.
//! The limit does not apply in a boot, a homing apart: torque is zero, and SYNC jitter has no effect.

use std::time::Duration;

use canopen::load::network::Assumptions;
use units::time::Instant;

/// Earliest time of the next request.
#[derive(Clone, Copy, Debug)]
pub(super) struct SdoPacer {
    gap: Duration,
    next: Instant,
}

impl SdoPacer {
    /// Returns a pacer that lets the first request pass.
    pub(super) fn new() -> Self {
        let gap = Assumptions::default().sdo_gap_us;
        Self { gap: Duration::from_micros(gap.into()), next: Instant::ZERO }
    }

    /// Returns whether a request may be sent now.
    pub(super) fn may_send(&self, now: Instant) -> bool {
        now >= self.next
    }

    /// Starts the gap after a request.
    pub(super) fn on_sent(&mut self, now: Instant) {
        self.next = now + self.gap;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_10_ms_apart() {
        let mut pacer = SdoPacer::new();
        let is_sent = |millis: &u64| {
            let now = Instant::from_micros(1_000 * millis);
            let may = pacer.may_send(now);
            if may {
                pacer.on_sent(now);
            }
            may
        };
        let sent: Vec<u64> = (7..60).filter(is_sent).collect();
        assert_eq!(sent, [7, 17, 27, 37, 47, 57]);
    }
}
