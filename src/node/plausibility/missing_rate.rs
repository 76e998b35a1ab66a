//! Rate of missing samples of each joint over the last second.
//!
//! Lost samples stop the node earlier, as overdue ones. This check finds samples that arrive late and are compensated,
//! or that are rejected as implausible: many windows stay empty, but few samples are overdue.
//!
//! The samples are counted in slots of 100 ms over the last second. Long cycles extend that to 200 cycles, because
//! single losses would dominate fewer. A loss rate of 0.1 % never comes near 5 %: 1 expected cycle of 1,000, not 50.

use std::time::Duration;

use crate::cause::Cause;
use units::numbering::Joint;

/// Slots of the observed time.
const SLOTS: usize = 10;

/// Duration of a slot: ten of them are the second in which missing samples count.
const SLOT_TIME: Duration = Duration::from_millis(100);

/// Minimum cycles of a slot.
const MIN_SLOT_CYCLES: u32 = 20;

/// Missing samples of all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct MissingRate {
    /// Cycles in 100 ms, the duration of a slot.
    slot_cycles: u32,
    /// Maximum missing samples of a joint in all slots.
    max_missing: u32,
    /// Elapsed cycles of the current slot.
    cycles: u32,
    /// Index of the current slot.
    slot: usize,
    /// Missing samples of each joint in each slot.
    missing: [[u32; 6]; SLOTS],
}

impl MissingRate {
    /// Returns counts of zero, for one sample every `period`, at most `max_percent` of them missing.
    pub(super) fn new(period: Duration, max_percent: u32) -> Self {
        let cycles = SLOT_TIME.as_micros() / period.as_micros().max(1);
        let slot_cycles =
            u32::try_from(cycles).unwrap_or(u32::MAX).clamp(MIN_SLOT_CYCLES, u32::MAX / 1_000);
        let all = slot_cycles.saturating_mul(10);
        let max_missing = all.saturating_mul(max_percent) / 100;
        Self { slot_cycles, max_missing, cycles: 0, slot: 0, missing: [[0; 6]; SLOTS] }
    }

    /// Ends a cycle. `fresh` marks the joints with a sample of it.
    pub(super) fn end_cycle(&mut self, fresh: &[bool; 6]) -> Option<Cause> {
        if self.cycles >= self.slot_cycles {
            self.cycles = 0;
            self.slot = (self.slot + 1) % SLOTS;
            self.missing.iter_mut().skip(self.slot).take(1).for_each(|slot| *slot = [0; 6]);
        }
        self.cycles += 1;
        if let Some(slot) = self.missing.get_mut(self.slot) {
            for (missing, _) in slot.iter_mut().zip(fresh).filter(|(_, fresh)| !**fresh) {
                *missing += 1;
            }
        }
        let mut joints = Joint::ALL.into_iter().map(|joint| (joint, self.missing(joint)));
        let (joint, missing) = joints.find(|(_, missing)| *missing > self.max_missing)?;
        let percent = missing.saturating_mul(10) / self.slot_cycles;
        Some(Cause::SamplesRare { joint, percent })
    }

    /// Returns the missing samples of `joint` in all slots.
    fn missing(&self, joint: Joint) -> u32 {
        self.missing.iter().map(|slot| joint.entry(slot)).sum()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIODS_US: [u64; 4] = [250, 1_000, 2_000, 100_000];

    fn rate(period_us: u64) -> MissingRate {
        MissingRate::new(Duration::from_micros(period_us), 5)
    }

    fn all_but(joint: Joint, is_missing: bool) -> [bool; 6] {
        Joint::ALL.map(|other| !(is_missing && other == joint))
    }

    #[test]
    fn hazard_03_more_than_5_percent_missing_is_a_fault_within_1_s() {
        let mut rate = rate(1_000);
        let fault = (1..=2_000).find_map(|cycle: u32| {
            let cause = rate.end_cycle(&all_but(Joint::of::<4>(), cycle.is_multiple_of(19)));
            cause.map(|cause| (cycle, cause))
        });
        let (cycle, cause) = fault.unwrap();
        assert_eq!(cause, Cause::SamplesRare { joint: Joint::of::<4>(), percent: 5 });
        assert!(cycle <= 1_000, "{cycle}");
    }

    #[test]
    fn five_percent_missing_is_tolerated() {
        for period in PERIODS_US {
            let mut rate = rate(period);
            for cycle in 1..20_000_u32 {
                assert_eq!(
                    rate.end_cycle(&all_but(Joint::of::<1>(), cycle.is_multiple_of(21))),
                    None,
                    "{period} µs"
                );
            }
        }
    }

    #[test]
    fn samples_missing_more_than_1_s_ago_do_not_count() {
        let mut rate = rate(1_000);
        for _ in 0..20 {
            for cycle in 0..1_000 {
                assert_eq!(rate.end_cycle(&all_but(Joint::of::<6>(), cycle < 50)), None);
            }
        }
    }

    proptest! {
        /// Each sample is lost with a probability of 0.1 %.
        #[test]
        fn promise_14_isolated_losses_never_reach_the_rate(
            lost in prop::collection::vec(prop::bool::weighted(0.001), 3_000), period in 0..4_usize
        ) {
            let mut rate = rate(PERIODS_US[period]);
            for lost in lost {
                prop_assert_eq!(rate.end_cycle(&all_but(Joint::of::<2>(), lost)), None);
            }
        }
    }
}
