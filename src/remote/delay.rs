//! Properties of a simulated link with delay to the commanded side.

use std::time::Duration;

/// Properties of a link; each direction has them alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelaySettings {
    /// Constant delay.
    pub delay: Duration,
    /// Maximum delay on top, uniformly distributed.
    pub jitter: Duration,
    /// Share of datagrams that are lost, 0 to 1.
    pub loss: f64,
    /// A datagram may overtake another by its jitter.
    pub reorders: bool,
    /// Start and end of an outage, since the first exchange: every datagram that is sent in it is lost.
    pub outage: Option<[Duration; 2]>,
    /// Cycle of the far side; not zero.
    pub period: Duration,
    /// Time without a new command after which the far side holds.
    pub hold_after: Duration,
    /// Seed of jitter and loss.
    pub seed: u64,
}

impl Default for DelaySettings {
    /// No delay, a far side at 1 kHz that holds after 100 ms without a command.
    fn default() -> Self {
        Self {
            delay: Duration::ZERO,
            jitter: Duration::ZERO,
            loss: 0.0,
            reorders: false,
            outage: None,
            period: Duration::from_millis(1),
            hold_after: Duration::from_millis(100),
            seed: 1,
        }
    }
}

impl DelaySettings {
    /// Maximum age that samples reach without loss, beside the node's own cycle: both ways, and the far side's cycle.
    pub fn round_trip(&self) -> Duration {
        (self.delay + self.jitter) * 2 + self.period
    }

    /// Returns whether the outage lasts at this time since the first exchange.
    pub fn is_out(&self, elapsed: Duration) -> bool {
        self.outage.is_some_and(|[start, end]| (start..end).contains(&elapsed))
    }
}
