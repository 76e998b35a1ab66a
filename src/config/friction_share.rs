//! Largest share of friction compensation that satisfies a condition, for the message about one that does not.

use crate::parameters::Parameters;
use controller::friction::{FrictionCompensation, FrictionSettings};

/// Returns the largest share in hundredths, below the configured one, with which the configuration `holds`; `None` without
/// friction compensation.
pub(super) fn largest(config: &Parameters, holds: impl Fn(&Parameters) -> bool) -> Option<f64> {
    let settings = *config.controller.extensions.friction.as_ref()?.settings();
    let shares = (0..100_u8).rev().map(|hundredths| f64::from(hundredths) / 100.0);
    let mut changed = config.clone();
    shares.filter(|share| *share < settings.share).find(|share| {
        let settings = FrictionSettings { share: *share, ..settings };
        changed.controller.extensions.friction = FrictionCompensation::new(settings).ok();
        holds(&changed)
    })
}
