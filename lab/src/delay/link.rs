//! Delay, jitter and loss of a link, and the largest K_T that the gain check accepts with it.

use std::time::Duration;

use serde::Serialize;

use config::{Config, RemoteLink};
use controller::gains::Gains;
use controller::stability::finding::Verdict;
use remote::delay::DelaySettings;

/// Steps of the bisection for the largest gain.
const HALVINGS: u32 = 24;

/// Largest K_T of translations that is tried.
const MAX_GAIN: f64 = 8.0;

/// Link between node and object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LinkConditions {
    /// Constant delay per direction, in ms.
    pub delay_ms: f64,
    /// Maximum of the random delay added to it, in ms.
    pub jitter_ms: f64,
    /// Lost datagrams, in percent.
    pub loss_percent: f64,
    /// Jitter may reorder datagrams.
    pub reorders: bool,
    /// Maximum age of a sample, in ms.
    pub max_age_ms: f64,
    /// Start and end of an outage since the start of the node, in s.
    pub outage_s: Option<[f64; 2]>,
}

impl LinkConditions {
    /// Creates a link from its delay per direction and the maximum age of a sample, both in ms.
    pub fn new([delay_ms, max_age_ms]: [f64; 2]) -> Self {
        Self { delay_ms, max_age_ms, ..Self::default() }
    }

    /// Returns the settings of a configuration for this link; `seed` seeds jitter and loss.
    pub fn settings(&self, seed: u64) -> RemoteLink {
        let millis = |ms: f64| Duration::from_secs_f64(ms.max(0.0) / 1e3);
        let simulated = DelaySettings {
            delay: millis(self.delay_ms),
            jitter: millis(self.jitter_ms),
            loss: self.loss_percent / 100.0,
            reorders: self.reorders,
            outage: self.outage_s.map(|outage| outage.map(|at| millis(1e3 * at))),
            seed,
            ..DelaySettings::default()
        };
        RemoteLink { max_age: millis(self.max_age_ms), simulated: Some(simulated) }
    }

    /// Returns whether a round trip with jitter, plus one cycle, is within the maximum age of a sample.
    pub fn is_usable(&self, config: &Config) -> bool {
        let RemoteLink { max_age, simulated } = self.settings(1);
        simulated.is_none_or(|link| link.round_trip() + config.period <= max_age)
    }
}

/// Returns `config` with this K_T along x, and the others in proportion. If K_T along x was zero, all become zero.
#[must_use]
pub fn with_wrench_gain(config: &Config, k_t: f64) -> Config {
    let configured = *config.controller.reflection.gain();
    let [along_x, ..] = *configured.values();
    let share = if along_x > 0.0 { k_t / along_x } else { 0.0 };
    let scaled = Gains::new(configured.values().map(|gain| gain * share), "K_T");
    let law = config.remote.interaction.accommodation;
    config.clone().with_switches_at(scaled.unwrap_or(configured), law)
}

/// Returns the largest K_T along x with which the gain check refuses nothing of `config`.
pub fn largest_accepted(config: &Config) -> f64 {
    let (mut low, mut high) = (0.0, MAX_GAIN);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if is_accepted(&with_wrench_gain(config, middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Returns whether the gain check refuses nothing of `config`.
pub fn is_accepted(config: &Config) -> bool {
    config.findings().iter().all(|finding| finding.verdict != Verdict::Refuses)
}
