//! Parameters of a simulated link with delay to the commanded side.

use std::time::Duration;

/// Default age of the newest command after which a far side holds.
pub const HOLD_AFTER: Duration = Duration::from_millis(100);

/// Parameters of a link, the same in both directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelaySettings {
    /// Constant delay.
    pub delay: Duration,
    /// Maximum additional delay, uniformly distributed.
    pub jitter: Duration,
    /// Fraction of datagrams lost, 0 to 1.
    pub loss: f64,
    /// Jitter may reorder datagrams.
    pub reorders: bool,
    /// Start and end of an outage, since the first exchange; datagrams sent in it are lost.
    pub outage: Option<[Duration; 2]>,
    /// Cycle period of the far side; not zero.
    pub period: Duration,
    /// Time without a new command after which the far side holds.
    pub hold_after: Duration,
    /// Random seed of jitter and loss.
    pub seed: u64,
}

impl Default for DelaySettings {
    /// Returns a link without delay or loss, to a far side at 1 kHz that holds after 100 ms without a command.
    fn default() -> Self {
        Self {
            delay: Duration::ZERO,
            jitter: Duration::ZERO,
            loss: 0.0,
            reorders: false,
            outage: None,
            period: Duration::from_millis(1),
            hold_after: HOLD_AFTER,
            seed: 1,
        }
    }
}

impl DelaySettings {
    /// Returns the maximum age of samples without loss: both directions and the far side's cycle, without the node's.
    pub fn round_trip(&self) -> Duration {
        (self.delay + self.jitter) * 2 + self.period
    }

    /// Returns whether the link is out at this time since the first exchange.
    pub fn is_out(&self, elapsed: Duration) -> bool {
        self.outage.is_some_and(|[start, end]| (start..end).contains(&elapsed))
    }
}
