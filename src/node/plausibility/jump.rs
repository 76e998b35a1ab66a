//! Whether a joint can have come from its last good position to the next: its encoder may jump, it cannot.
//!
//! One position too far away is not believed and forgiven; a second soon after is a jump. Differences are
//! taken modulo 2³², as the counter wraps, so that running over its end is no jump.

use std::time::Duration;

use crate::plausibility::repeated::Repeated;
use units::drive::Counts;
use units::time::Instant;

/// A second rejected position within this is a jump.
const SOON: Duration = Duration::from_millis(100);

/// Counts that an encoder at rest goes back and forth.
const NOISE: u64 = 2;

/// How far a joint may come in a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// In counts.
    per_second: u32,
    /// What any time may seem too short by.
    slack: Duration,
}

impl Reach {
    /// At most `per_second` counts a second, where one SYNC is half a `period` late at most, and the next
    /// in time: one and a half times of what is allowed in one cycle, two and a half of it in two.
    pub(super) fn new(per_second: u32, period: Duration) -> Self {
        Self { per_second, slack: period / 2 }
    }

    /// Whether a joint can come from one position to the other within `span`.
    pub(super) fn joins(&self, from: Counts, to: Counts, span: Duration) -> bool {
        let micros = u64::try_from((span + self.slack).as_micros()).unwrap_or(u64::MAX);
        let reach = u64::from(self.per_second).saturating_mul(micros) / 1_000_000 + NOISE;
        u64::from(to.0.wrapping_sub(from.0).unsigned_abs()) <= reach
    }
}

/// What is to be made of a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// The joint can be there.
    Possible,
    /// It cannot; forgiven once.
    Impossible,
    /// It cannot, again.
    Jumped,
}

/// The watch on one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jump {
    reach: Reach,
    last: Option<Good>,
    rejected: Repeated,
}

/// A position that was possible.
#[derive(Clone, Copy, Debug)]
struct Good {
    position: Counts,
    at: Instant,
    /// By how much it may be older than `at`.
    late: Duration,
}

impl Jump {
    /// The first position may be any.
    pub(super) const fn new(reach: Reach) -> Self {
        Self { reach, last: None, rejected: Repeated::new(SOON) }
    }

    /// Takes the sample of the SYNC of `at`, which may be older by `late`. It may also be older than the
    /// last one, if that one came in time and this one did not.
    pub(super) fn take(&mut self, at: Instant, position: Counts, late: Duration) -> Step {
        let is_possible = self.last.is_none_or(|last| {
            let since = at.since(last.at) + last.late;
            self.reach.joins(last.position, position, since.max(late))
        });
        if is_possible {
            self.last = Some(Good { position, at, late });
            Step::Possible
        } else if self.rejected.happens(at) {
            Step::Jumped
        } else {
            Step::Impossible
        }
    }

    /// The last sample may be older by `span` than was thought: another came behind it.
    pub(super) fn doubt(&mut self, span: Duration) {
        if let Some(last) = &mut self.last {
            last.late += span;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const T: Duration = Duration::from_millis(1);

    /// 1,000 counts in a cycle.
    fn reach() -> Reach {
        Reach::new(1_000_000, T)
    }

    fn at(cycle: u64) -> Instant {
        Instant::from_micros(1_000 * cycle)
    }

    fn steps(positions: impl IntoIterator<Item = (u64, i32)>) -> Vec<Step> {
        let mut jump = Jump::new(reach());
        let step = |(cycle, position)| jump.take(at(cycle), Counts(position), Duration::ZERO);
        positions.into_iter().map(step).collect()
    }

    #[test]
    fn hazard_12_a_jump_is_rejected_and_a_second_soon_after_is_told() {
        use Step::Impossible;
        use Step::Jumped;
        use Step::Possible;
        let there_and_back = steps([(0, 7), (1, 1_100_000), (2, 8)]);
        assert_eq!(there_and_back, [Possible, Impossible, Possible]);
        assert_eq!(steps([(0, 7), (1, 5_000), (2, 5_000)]), [Possible, Impossible, Jumped]);
        let flickering = steps([(0, 7), (1, 5_000), (2, 8), (100, 9_999_999), (101, 9)]);
        assert_eq!(flickering, [Possible, Impossible, Possible, Jumped, Possible]);
        let much_later = steps([(0, 7), (1, 5_000), (2, 8), (102, 9_999_999)]);
        assert_eq!(much_later, [Possible, Impossible, Possible, Impossible]);
    }

    #[test]
    fn hazard_04_what_a_late_sample_makes_of_a_motion_is_no_jump() {
        let mut jump = Jump::new(reach());
        jump.take(at(0), Counts(0), Duration::ZERO);
        // Window 1 is empty; its sample is the first of window 2, and that of window 2 comes behind it.
        assert_eq!(jump.take(at(2), Counts(1_000), T), Step::Possible);
        jump.doubt(T);
        assert_eq!(jump.take(at(3), Counts(3_000), Duration::ZERO), Step::Possible);
        // Two cycles old, and the one before it was not: backwards.
        assert_eq!(jump.take(at(4), Counts(2_000), T * 2), Step::Possible);
    }

    proptest! {
        #[test]
        fn property_14_a_wrap_at_any_count_and_any_speed_allowed_is_no_jump(
            before in 0..20_000_i32,
            is_upwards in any::<bool>(),
            motions in prop::collection::vec((500..=1_000_i32, 1..4_u64), 50..200),
        ) {
            // At least 25,000 counts one way, from less than 20,000 before the end: always over it.
            let start = if is_upwards { i32::MAX - before } else { i32::MIN + before };
            let motions = motions.into_iter().map(|(motion, cycles)| match is_upwards {
                true => (motion, cycles),
                false => (-motion, cycles),
            });
            let (mut position, mut cycle) = (start, 0);
            let mut jump = Jump::new(reach());
            jump.take(at(0), Counts(start), Duration::ZERO);
            for (motion, cycles) in motions {
                cycle += cycles;
                position = (0..cycles).fold(position, |position, _| position.wrapping_add(motion));
                let step = jump.take(at(cycle), Counts(position), Duration::ZERO);
                prop_assert_eq!(step, Step::Possible);
            }
            prop_assert!((position < start) == is_upwards, "{} to {}", start, position);
        }

        #[test]
        fn property_14_a_motion_farther_than_allowed_is_rejected_wherever_it_begins(
            start in any::<i32>(), far in 1_503..=i32::MAX, backwards in any::<bool>()
        ) {
            let to = if backwards { start.wrapping_sub(far) } else { start.wrapping_add(far) };
            prop_assert_eq!(steps([(0, start), (1, to)])[1], Step::Impossible);
        }
    }
}
