//! How many of a joint's samples are missing of late.
//!
//! Samples that are lost stop the node earlier, as overdue. This watch is for those that come late and are made good,
//! or that are discarded because they cannot be: of each many windows stay empty, and few samples are overdue.
//!
//! Counted in tenths of a second over the last second, or over the last 200 cycles where those take longer:
//! a share of fewer would be made by single losses. A thousandth of lost samples, one by one, never comes
//! near a twentieth: 50 of 1,000 cycles where one is expected.

use std::time::Duration;

use crate::cause::Cause;
use units::numbering::Joint;

/// The parts of the time that is looked back on.
const PARTS: usize = 10;

/// How long each part is.
const PART: Duration = Duration::from_millis(100);

/// The least cycles in a part.
const LEAST: u32 = 20;

/// The watch on all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    /// Cycles of one part.
    part: u32,
    /// The most that may be missing.
    most: u32,
    /// Cycles of this part that are over.
    cycles: u32,
    /// Where this part's numbers are.
    now: usize,
    missing: [[u32; 6]; PARTS],
}

impl Rate {
    /// At one sample every `period`, of which `most_percent` may be missing.
    pub(super) fn new(period: Duration, most_percent: u32) -> Self {
        let cycles = PART.as_micros() / period.as_micros().max(1);
        let part = u32::try_from(cycles).unwrap_or(u32::MAX).clamp(LEAST, u32::MAX / 1_000);
        let all = part.saturating_mul(10);
        let most = all.saturating_mul(most_percent) / 100;
        Self { part, most, cycles: 0, now: 0, missing: [[0; 6]; PARTS] }
    }

    /// A cycle is over, in which these joints were sampled.
    pub(super) fn end(&mut self, fresh: &[bool; 6]) -> Option<Cause> {
        if self.cycles >= self.part {
            self.cycles = 0;
            self.now = (self.now + 1) % PARTS;
            self.missing.iter_mut().skip(self.now).take(1).for_each(|part| *part = [0; 6]);
        }
        self.cycles += 1;
        if let Some(part) = self.missing.get_mut(self.now) {
            for (missing, _) in part.iter_mut().zip(fresh).filter(|(_, fresh)| !**fresh) {
                *missing += 1;
            }
        }
        let mut joints = Joint::ALL.into_iter().map(|joint| (joint, self.of(joint)));
        let (joint, missing) = joints.find(|(_, missing)| *missing > self.most)?;
        let percent = missing.saturating_mul(10) / self.part;
        Some(Cause::SamplesRare { joint, percent })
    }

    /// How many of a joint's samples are missing of late.
    fn of(&self, joint: Joint) -> u32 {
        self.missing.iter().map(|part| joint.entry(part)).sum()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIODS_US: [u64; 4] = [250, 1_000, 2_000, 100_000];

    fn rate(period_us: u64) -> Rate {
        Rate::new(Duration::from_micros(period_us), 5)
    }

    fn but_joint(joint: Joint, is_missing: bool) -> [bool; 6] {
        Joint::ALL.map(|other| !(is_missing && other == joint))
    }

    #[test]
    fn hazard_03_more_than_a_twentieth_missing_is_told_within_the_second() {
        let mut rate = rate(1_000);
        let told = (1..=2_000).find_map(|cycle: u32| {
            let cause = rate.end(&but_joint(Joint::of::<4>(), cycle.is_multiple_of(19)));
            cause.map(|cause| (cycle, cause))
        });
        let (cycle, cause) = told.unwrap();
        assert_eq!(cause, Cause::SamplesRare { joint: Joint::of::<4>(), percent: 5 });
        assert!(cycle <= 1_000, "{cycle}");
    }

    #[test]
    fn a_twentieth_is_borne_for_ever() {
        for period in PERIODS_US {
            let mut rate = rate(period);
            for cycle in 1..20_000_u32 {
                assert_eq!(
                    rate.end(&but_joint(Joint::of::<1>(), cycle.is_multiple_of(21))),
                    None,
                    "{period} µs"
                );
            }
        }
    }

    #[test]
    fn what_was_missing_more_than_a_second_ago_is_forgotten() {
        let mut rate = rate(1_000);
        for _ in 0..20 {
            for cycle in 0..1_000 {
                assert_eq!(rate.end(&but_joint(Joint::of::<6>(), cycle < 50)), None);
            }
        }
    }

    proptest! {
        /// Each sample lost with a chance of one in a thousand.
        #[test]
        fn promise_14_isolated_losses_never_reach_it(
            lost in prop::collection::vec(prop::bool::weighted(0.001), 3_000), period in 0..4_usize
        ) {
            let mut rate = rate(PERIODS_US[period]);
            for lost in lost {
                prop_assert_eq!(rate.end(&but_joint(Joint::of::<2>(), lost)), None);
            }
        }
    }
}
