//! Detection of encoder jumps: positions farther from the last plausible one than the joint can move.
//!
//! A single implausible position is rejected and tolerated; a second one soon after is a jump. Differences are taken
//! modulo 2³², like the counter, so that its wrap-around is no jump.

use std::time::Duration;

use crate::plausibility::repeat_detector::RepeatDetector;
use units::drive::Counts;
use units::time::Instant;

/// Time within which a second rejected position is a jump.
const REJECTION_WINDOW: Duration = Duration::from_millis(100);

/// Noise of an encoder at rest, in counts.
const NOISE_COUNTS: u64 = 2;

/// Maximum travel of a joint in a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct TravelLimit {
    /// Maximum speed, in counts/s.
    per_second: u32,
    /// Maximum error of the time between two SYNCs.
    sync_jitter: Duration,
}

impl TravelLimit {
    /// Returns the limit for a maximum speed in counts/s. A SYNC may be late by half a `period` and the next one on time.
    /// One cycle therefore allows the travel of 1.5 periods, two cycles that of 2.5.
    pub(super) fn new(per_second: u32, period: Duration) -> Self {
        Self { per_second, sync_jitter: period / 2 }
    }

    /// Returns whether a joint can move from one position to the other within `span`.
    pub(super) fn allows(&self, from: Counts, to: Counts, span: Duration) -> bool {
        let micros = u64::try_from((span + self.sync_jitter).as_micros()).unwrap_or(u64::MAX);
        let travel = u64::from(self.per_second).saturating_mul(micros) / 1_000_000 + NOISE_COUNTS;
        u64::from(to.0.wrapping_sub(from.0).unsigned_abs()) <= travel
    }
}

/// Plausibility of a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Within the travel limit.
    Plausible,
    /// Beyond the travel limit, for the first time.
    Implausible,
    /// Beyond the travel limit, again.
    Jumped,
}

/// Jump detection of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jump {
    limit: TravelLimit,
    last: Option<PlausiblePosition>,
    rejections: RepeatDetector,
}

/// Last plausible position.
#[derive(Clone, Copy, Debug)]
struct PlausiblePosition {
    position: Counts,
    at: Instant,
    /// Maximum delay: it was sampled at most this long before `at`.
    max_delay: Duration,
}

impl Jump {
    /// Returns a detector that accepts any first position.
    pub(super) const fn new(limit: TravelLimit) -> Self {
        Self { limit, last: None, rejections: RepeatDetector::new(REJECTION_WINDOW) }
    }

    /// Checks the position received after the SYNC of `at`, sampled up to `max_delay` before it. It may be older than the
    /// last position if that was not delayed.
    pub(super) fn check(&mut self, at: Instant, position: Counts, max_delay: Duration) -> Step {
        let is_plausible = self.last.is_none_or(|last| {
            let span = at.since(last.at) + last.max_delay;
            self.limit.allows(last.position, position, span.max(max_delay))
        });
        if is_plausible {
            self.last = Some(PlausiblePosition { position, at, max_delay });
            Step::Plausible
        } else if self.rejections.on_event(at) {
            Step::Jumped
        } else {
            Step::Implausible
        }
    }

    /// Adds `span` to the maximum delay of the last position: a further response of its window was received.
    pub(super) fn allow_delay(&mut self, span: Duration) {
        if let Some(last) = &mut self.last {
            last.max_delay += span;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const T: Duration = Duration::from_millis(1);

    /// Returns a limit of 1,000 counts in a cycle.
    fn limit() -> TravelLimit {
        TravelLimit::new(1_000_000, T)
    }

    fn at(cycle: u64) -> Instant {
        Instant::from_micros(1_000 * cycle)
    }

    fn steps(positions: impl IntoIterator<Item = (u64, i32)>) -> Vec<Step> {
        let mut jump = Jump::new(limit());
        let step = |(cycle, position)| jump.check(at(cycle), Counts(position), Duration::ZERO);
        positions.into_iter().map(step).collect()
    }

    #[test]
    fn hazard_12_second_jump_soon_after_is_a_fault() {
        use Step::{Implausible, Jumped, Plausible};
        let single = steps([(0, 7), (1, 1_100_000), (2, 8)]);
        assert_eq!(single, [Plausible, Implausible, Plausible]);
        assert_eq!(steps([(0, 7), (1, 5_000), (2, 5_000)]), [Plausible, Implausible, Jumped]);
        let flickering = steps([(0, 7), (1, 5_000), (2, 8), (100, 9_999_999), (101, 9)]);
        assert_eq!(flickering, [Plausible, Implausible, Plausible, Jumped, Plausible]);
        let later = steps([(0, 7), (1, 5_000), (2, 8), (102, 9_999_999)]);
        assert_eq!(later, [Plausible, Implausible, Plausible, Implausible]);
    }

    #[test]
    fn hazard_04_late_sample_in_motion_is_no_jump() {
        let mut jump = Jump::new(limit());
        jump.check(at(0), Counts(0), Duration::ZERO);
        // Window 1 is empty; its sample is the first of window 2, followed by the sample of window 2.
        assert_eq!(jump.check(at(2), Counts(1_000), T), Step::Plausible);
        jump.allow_delay(T);
        assert_eq!(jump.check(at(3), Counts(3_000), Duration::ZERO), Step::Plausible);
        // Two cycles old, unlike the one before: the position steps back.
        assert_eq!(jump.check(at(4), Counts(2_000), T * 2), Step::Plausible);
    }

    proptest! {
        #[test]
        fn property_14_wrap_at_any_count_and_allowed_speed_is_no_jump(
            before in 0..20_000_i32,
            is_upwards in any::<bool>(),
            motions in prop::collection::vec((500..=1_000_i32, 1..4_u64), 50..200),
        ) {
            // At least 25,000 counts one way, from less than 20,000 before the end: always wraps.
            let start = if is_upwards { i32::MAX - before } else { i32::MIN + before };
            let motions = motions.into_iter().map(|(motion, cycles)| match is_upwards {
                true => (motion, cycles),
                false => (-motion, cycles),
            });
            let (mut position, mut cycle) = (start, 0);
            let mut jump = Jump::new(limit());
            jump.check(at(0), Counts(start), Duration::ZERO);
            for (motion, cycles) in motions {
                cycle += cycles;
                position = (0..cycles).fold(position, |position, _| position.wrapping_add(motion));
                let step = jump.check(at(cycle), Counts(position), Duration::ZERO);
                prop_assert_eq!(step, Step::Plausible);
            }
            prop_assert!((position < start) == is_upwards, "{} to {}", start, position);
        }

        #[test]
        fn property_14_motion_beyond_the_limit_is_rejected_anywhere(
            start in any::<i32>(), far in 1_503..=i32::MAX, backwards in any::<bool>()
        ) {
            let to = if backwards { start.wrapping_sub(far) } else { start.wrapping_add(far) };
            prop_assert_eq!(steps([(0, start), (1, to)])[1], Step::Implausible);
        }
    }
}
