//! Comparison of actual torque (6077h) with target torque (6071h).
//!
//! A target sent in one cycle acts at the next SYNC, is reached some tenths of a millisecond later, and is sampled at the
//! SYNC after that; the sample may be late. So a reading must lie between the minimum and the maximum of the last
//! targets, give or take the tolerance. This needs no model of the current loop, and compares no reading with a target
//! that is too old or too new.
//!
//! A difference is a fault if all readings for its time, and at least two, are off. With one reading per 107 SYNCs that
//! is the second one: 107 to 214 cycles instead of 50.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::sampled::Sampled;
use units::numbering::Joint;
use units::time::Instant;

/// Cycles before a reading in which its target may have been sent.
const TARGET_CYCLES: usize = 5;

/// Torque check of all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Torque {
    /// Maximum difference, in ‰ of rated torque.
    tolerance: i32,
    /// Time for which a larger difference is tolerated.
    max_difference_time: Duration,
    /// Ring of the last targets, in ‰ of rated torque.
    targets: [[i16; 6]; TARGET_CYCLES],
    /// Index of the oldest targets.
    oldest: usize,
    /// Start of each joint's difference.
    differs_since: [Option<Instant>; 6],
}

impl Torque {
    /// Returns a check with all targets zero. Differences above `tolerance`, in ‰ of rated torque, are tolerated for less
    /// than `max_difference_time`.
    pub(super) const fn new(tolerance: u16, max_difference_time: Duration) -> Self {
        let targets = [[0; 6]; TARGET_CYCLES];
        #[expect(clippy::as_conversions, reason = "i32::from is not const; it always fits")]
        let tolerance = tolerance as i32;
        Self { tolerance, max_difference_time, targets, oldest: 0, differs_since: [None; 6] }
    }

    /// Takes the target torques sent in a cycle, in ‰ of rated torque.
    pub(super) fn on_sent(&mut self, targets: &[i16; 6]) {
        self.targets.iter_mut().skip(self.oldest).take(1).for_each(|oldest| *oldest = *targets);
        self.oldest = (self.oldest + 1) % TARGET_CYCLES;
    }

    /// Checks the actual torques received in this cycle.
    pub(super) fn check(&mut self, sampled: &Sampled<'_>) -> Option<Cause> {
        let mut differs = None;
        let readings = sampled.latest.iter().zip(sampled.torques);
        for (joint, (sample, _)) in Joint::each(readings).filter(|(_, (_, is_read))| *is_read) {
            let is_off = self.is_off(joint, i32::from(sample.torque.0));
            let since = joint.entry_mut(&mut self.differs_since);
            *since = if is_off { since.or(Some(sampled.at)) } else { None };
            let time = since.map(|since| sampled.at.since(since));
            if time.is_some_and(|time| time >= self.max_difference_time) {
                differs = differs.or(Some(Cause::TorqueDiffers { joint }));
            }
        }
        differs
    }

    /// Returns whether `actual` is outside the range of the last targets, in ‰ of rated torque.
    fn is_off(&self, joint: Joint, actual: i32) -> bool {
        let targets = || self.targets.iter().map(|targets| i32::from(*joint.entry(targets)));
        let min = targets().min().unwrap_or(0).saturating_sub(self.tolerance);
        let max = targets().max().unwrap_or(0).saturating_add(self.tolerance);
        !(min..=max).contains(&actual)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::pdo::DriveSample;
    use units::drive::PerMille;

    /// Returns the cycle of 1 ms of the fault. The elbow reports its actual torque every `every` cycles.
    fn fault_cycle(
        every: usize,
        target: impl Fn(usize) -> i16,
        actual: impl Fn(usize) -> i16,
    ) -> Option<usize> {
        let mut torque = Torque::new(150, Duration::from_millis(50));
        (0..1_000).find(|&cycle| {
            let at = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            let mut latest = [DriveSample::default(); 6];
            latest[2].torque = PerMille(actual(cycle));
            let mut torques = [false; 6];
            torques[2] = cycle.is_multiple_of(every);
            let sampled = Sampled { at, latest: &latest, fresh: [true; 6], torques };
            let cause = torque.check(&sampled);
            torque.on_sent(&[0, 0, target(cycle), 0, 0, 0]);
            assert!(
                cause.is_none_or(|cause| cause == Cause::TorqueDiffers { joint: Joint::of::<3>() })
            );
            cause.is_some()
        })
    }

    #[test]
    fn hazard_10_half_the_torque_is_a_fault_after_50_ms() {
        let half_from = |begin| move |cycle| if cycle < begin { 400 } else { 200 };
        assert_eq!(fault_cycle(1, |_| 400, half_from(200)), Some(250));
        assert_eq!(fault_cycle(107, |_| 400, half_from(215)), Some(428), "read at 321 and 428");
    }

    #[test]
    fn hazard_10_small_or_short_difference_is_no_fault() {
        assert_eq!(fault_cycle(1, |_| 400, |_| 251), None);
        assert_eq!(fault_cycle(1, |_| 400, |cycle| if cycle % 60 < 50 { 0 } else { 400 }), None);
    }

    #[test]
    fn torque_without_a_target_is_a_fault() {
        assert_eq!(fault_cycle(1, |_| 0, |cycle| if cycle < 100 { 0 } else { -300 }), Some(150));
    }

    proptest! {
        /// A reading is one to five cycles later than its target; targets are arbitrary.
        #[test]
        fn promise_14_late_reading_of_any_target_is_no_fault(
            targets in prop::collection::vec(any::<i16>(), 1_000), late in 1..=TARGET_CYCLES, every in 1..120_usize
        ) {
            let actual = |cycle: usize| cycle.checked_sub(late).map_or(0, |cycle| targets[cycle]);
            prop_assert_eq!(fault_cycle(every, |cycle| targets[cycle], actual), None);
        }
    }
}
