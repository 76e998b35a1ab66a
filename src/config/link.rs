//! `[remote.link]`: maximum age of samples from the commanded side, and the delays of a simulated link to it.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
use crate::remote;
use crate::value::{HasPlace, Optional, Place};
use ::remote::delay::DelaySettings;
use toml_input::List;

/// Range of the maximum age of a sample, in ms (ADR 16).
const MAX_AGE_MS: std::ops::RangeInclusive<f64> = 5.0..=100.0;

/// Bounds of the default maximum age of a sample.
const DEFAULT_AGE: [Duration; 2] = [Duration::from_millis(20), Duration::from_millis(100)];

/// Default maximum age of a sample, in periods.
const MAX_MISSED_SAMPLES: u32 = 3;

/// Maximum delay and maximum jitter in each direction, in ms.
const MAX_DELAY_MS: f64 = 100.0;

/// Range of the time after which the far side holds, in ms.
pub(super) const HOLD_AFTER_MS: std::ops::RangeInclusive<f64> = 1.0..=1_000.0;

/// Latest end of an outage, in s.
const MAX_OUTAGE_S: f64 = 86_400.0;

/// Maximum share of datagrams that are lost, in percent.
const MAX_LOSS_PERCENT: f64 = 90.0;

/// Link to the commanded side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemoteLink {
    /// Maximum age of a sample.
    pub max_age: Duration,
    /// Simulated delays; without them both sides are connected directly.
    pub simulated: Option<DelaySettings>,
}

impl RemoteLink {
    /// Returns a direct connection to a commanded side that is sampled every `period`.
    pub fn direct(period: Duration) -> Self {
        let [least, most] = DEFAULT_AGE;
        Self { max_age: (period * MAX_MISSED_SAMPLES).clamp(least, most), simulated: None }
    }
}

/// Reads the section, with defaults if it is absent. Returns `None` after a problem.
pub(super) fn read(
    file: &raw::File,
    period: Option<Duration>,
    problems: &mut Problems<'_>,
) -> Option<RemoteLink> {
    let raw = &file.remote.link;
    let given = match raw.max_age_ms.as_ref() {
        None => None,
        Some(_) => Some(problems.within(&raw.max_age_ms, MAX_AGE_MS).map(millis)?),
    };
    let is_real = remote::is_link(&file.remote);
    if is_real && let Some(place) = simulation_key(raw) {
        let reason = "describes a simulated link, and kind = \"link\" is a real one: remove it, or set remote.kind = \"virtual\"";
        problems.add(place, reason);
    }
    let is_simulated = is_simulated(raw) && !is_real;
    let simulated = if is_simulated { Some(simulated(raw, problems)?) } else { None };
    let period = period?;
    let max_age = given.unwrap_or(RemoteLink::direct(period).max_age);
    let link = RemoteLink { max_age, simulated };
    refuse_hopeless(&link, period, raw, problems);
    Some(link)
}

/// Returns whether a key describes a simulated link.
fn is_simulated(raw: &raw::RemoteLink) -> bool {
    !raw.hold_after_ms.is_absent() || simulation_key(raw).is_some()
}

/// Returns the first key that only a simulated link has.
fn simulation_key(raw: &raw::RemoteLink) -> Option<&Place> {
    let numbers = [&raw.delay_ms, &raw.jitter_ms, &raw.loss_percent];
    let number = numbers.into_iter().find(|key| !key.is_absent()).map(HasPlace::place);
    let reorder = (!raw.reorder.is_absent()).then(|| raw.reorder.place());
    let outage = (!raw.outage_s.is_absent()).then(|| raw.outage_s.place());
    let seed = (!raw.seed.is_absent()).then(|| raw.seed.place());
    number.or(reorder).or(outage).or(seed)
}

fn simulated(raw: &raw::RemoteLink, problems: &mut Problems<'_>) -> Option<DelaySettings> {
    let usual = DelaySettings::default();
    let mut at_most = |key: &Optional<f64>, most: f64| problems.within(&key.or(0.0), 0.0..=most);
    let delay = at_most(&raw.delay_ms, MAX_DELAY_MS);
    let jitter = at_most(&raw.jitter_ms, MAX_DELAY_MS);
    let loss = at_most(&raw.loss_percent, MAX_LOSS_PERCENT);
    let hold = raw.hold_after_ms.or(usual.hold_after.as_secs_f64() * 1e3);
    let hold_after = problems.within(&hold, HOLD_AFTER_MS);
    // Outer `None`: a problem. Inner `None`: no outage.
    let outage = match raw.outage_s.as_ref() {
        None if raw.outage_s.is_absent() => Some(None),
        _ => outage(raw, problems).map(Some),
    };
    Some(DelaySettings {
        delay: millis(delay?),
        jitter: millis(jitter?),
        loss: loss? / 100.0,
        reorders: raw.reorder.or(usual.reorders).get()?,
        outage: outage?,
        hold_after: millis(hold_after?),
        seed: raw.seed.or(usual.seed).get()?,
        ..usual
    })
}

/// Returns start and end of the outage.
fn outage(raw: &raw::RemoteLink, problems: &mut Problems<'_>) -> Option<[Duration; 2]> {
    let List([start, end]) = raw.outage_s.get()?;
    if !(0.0 <= start && start < end && end <= MAX_OUTAGE_S) {
        let reason = format_args!(
            "must ascend within 0..={MAX_OUTAGE_S}, got [{start}, {end}]: start and end in s"
        );
        problems.add(&raw.outage_s, reason);
        return None;
    }
    Some([start, end].map(|seconds| millis(1e3 * seconds)))
}

/// Refuses a link whose samples would always be too old, so that nothing would be reflected.
fn refuse_hopeless(
    link: &RemoteLink,
    period: Duration,
    raw: &raw::RemoteLink,
    problems: &mut Problems<'_>,
) {
    let RemoteLink { max_age, simulated: Some(simulated) } = link else { return };
    let age = simulated.round_trip() + period;
    if age > *max_age {
        let reason = format_args!(
            "samples would be up to {:.1} ms old (both ways with jitter, and a cycle of either side), and \
             max_age_ms is {}: the link would be lost; lower delay_ms and jitter_ms, or raise max_age_ms, at most to 100",
            age.as_secs_f64() * 1e3,
            max_age.as_secs_f64() * 1e3
        );
        let key = if raw.delay_ms.is_absent() { &raw.jitter_ms } else { &raw.delay_ms };
        problems.add(key, reason);
    } else if age > simulated.hold_after {
        let reason = format_args!(
            "must be at least {:.1} (both ways with jitter, and a cycle of either side), got {}: the far side would hold \
             all the time, since no command has a fresher echo",
            age.as_secs_f64() * 1e3,
            simulated.hold_after.as_secs_f64() * 1e3
        );
        problems.add(&raw.hold_after_ms, reason);
    }
}

pub(super) fn millis(value: f64) -> Duration {
    // Values out of range are already reported.
    Duration::try_from_secs_f64(value / 1e3).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn usual_age_is_three_periods_within_20_and_100_ms(micros in 250..100_000_u64) {
            let age = RemoteLink::direct(Duration::from_micros(micros)).max_age;
            prop_assert_eq!(age, Duration::from_micros((3 * micros).clamp(20_000, 100_000)));
        }
    }
}
