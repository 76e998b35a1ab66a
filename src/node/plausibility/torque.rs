//! Comparison of actual torque (6077h) with target torque (6071h).
//!
//! A reading must lie within the range of torques that the drive may report after the last targets
//! ([`TorqueRange`]). This needs no model of the current loop, and compares no reading with a target that is too old
//! or too new.
//!
//! A difference is a fault if all readings for its time, and at least two, are off. With one reading per 107 SYNCs that
//! is the second one: 107 to 214 cycles instead of 50.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::sample_set::SampleSet;
use crate::plausibility::torque_range::TorqueRange;
use units::numbering::Joint;
use units::time::Instant;

/// Torque check of all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Torque {
    /// Torques that the drives may report.
    range: TorqueRange,
    /// Time for which a larger difference is tolerated.
    max_difference_time: Duration,
    /// Start of each joint's difference.
    differs_since: [Option<Instant>; 6],
    /// Joints whose last reading only a low pass of the drive can explain.
    is_suspect: [bool; 6],
}

impl Torque {
    /// Returns a check of readings against `range`. Others are tolerated for less than `max_difference_time`.
    pub(super) const fn new(range: TorqueRange, max_difference_time: Duration) -> Self {
        Self { range, max_difference_time, differs_since: [None; 6], is_suspect: [false; 6] }
    }

    /// Takes the target torques sent in a cycle, in ‰ of rated torque.
    pub(super) fn on_sent(&mut self, targets: &[i16; 6]) {
        self.range.on_sent(targets);
    }

    /// Returns the joints whose last reading only a low pass of the drive can explain. They may hold another target.
    pub(super) const fn is_suspect(&self) -> [bool; 6] {
        self.is_suspect
    }

    /// Checks the actual torques received in this cycle.
    pub(super) fn check(&mut self, sampled: &SampleSet<'_>) -> Option<Cause> {
        let mut differs = None;
        let readings = sampled.latest.iter().zip(sampled.torques);
        for (joint, (sample, _)) in Joint::each(readings).filter(|(_, (_, is_read))| *is_read) {
            let is_off = !self.range.contains(joint, sample.torque.0);
            let is_prompt = self.range.contains_at_once(joint, sample.torque.0);
            *joint.entry_mut(&mut self.is_suspect) = !is_prompt;
            let since = joint.entry_mut(&mut self.differs_since);
            *since = if is_off { since.or(Some(sampled.at)) } else { None };
            let time = since.map(|since| sampled.at.since(since));
            if time.is_some_and(|time| time >= self.max_difference_time) {
                differs = differs.or(Some(Cause::TorqueDiffers { joint }));
            }
        }
        differs
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plausibility::torque_range::TARGET_CYCLES;
    use canopen::pdo::DriveSample;
    use units::drive::PerMille;
    use units::math;

    const PERIOD: Duration = Duration::from_millis(1);

    /// Returns the cycle of 1 ms of the fault. The elbow reports its actual torque every `every` cycles.
    fn fault_cycle(
        every: usize,
        target: impl Fn(usize) -> i16,
        actual: impl Fn(usize) -> i16,
    ) -> Option<usize> {
        fault_of(TorqueRange::within(150), every, target, actual)
    }

    /// Returns the cycle of the fault of a drive that reports in every cycle, judged by the targets before.
    fn fault_by_targets(
        target: impl Fn(usize) -> i16,
        actual: impl Fn(usize) -> i16,
    ) -> Option<usize> {
        fault_of(TorqueRange::following(PERIOD), 1, target, actual)
    }

    fn fault_of(
        range: TorqueRange,
        every: usize,
        target: impl Fn(usize) -> i16,
        actual: impl Fn(usize) -> i16,
    ) -> Option<usize> {
        let mut torque = Torque::new(range, Duration::from_millis(50));
        (0..1_000).find(|&cycle| {
            let at = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            let mut latest = [DriveSample::default(); 6];
            latest[2].torque = PerMille(actual(cycle));
            let mut torques = [false; 6];
            torques[2] = cycle.is_multiple_of(every);
            let demands = [None; 6];
            let sampled = SampleSet { at, latest: &latest, fresh: [true; 6], torques, demands };
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

    #[test]
    fn hazard_10_torque_held_after_the_end_of_torque_is_a_fault() {
        for held in [-273, -60, 60, 900] {
            let targets = |cycle| if cycle < 200 { held } else { 0 };
            let fault = fault_by_targets(targets, |cycle| if cycle == 0 { 0 } else { held });
            // The low pass that a drive may have excuses a share that falls by two thirds every 10 ms.
            assert!(fault.is_some_and(|fault| (250..290).contains(&fault)), "{held} ‰: {fault:?}");
        }
    }

    #[test]
    fn hazard_10_torque_held_beside_other_targets_is_a_fault() {
        let from = |begin, first, then| move |cycle| if cycle < begin { first } else { then };
        assert!(fault_by_targets(from(200, 273, 200), |_| 273).is_some_and(|it| it < 290));
        assert_eq!(fault_by_targets(from(200, 273, 240), |_| 273), None, "within 10 % and 20 ‰");
    }

    proptest! {
        /// A reading behind a low pass of up to 10 ms, off by up to 5 %, and one to five cycles late.
        #[test]
        fn promise_14_filtered_reading_of_any_target_is_no_fault(
            targets in prop::collection::vec(-1_500..1_500_i16, 1_000), late in 1..=TARGET_CYCLES,
            time_constant in 0.1..10.0_f64, gain in 0.95..1.05_f64
        ) {
            let pass = 1.0 - math::exp(-1.0 / time_constant);
            let filter = |output: &mut f64, target: &i16| {
                *output += pass * (f64::from(*target) - *output);
                Some((gain * *output).round())
            };
            let filtered: Vec<f64> = targets.iter().scan(0.0, filter).collect();
            #[expect(clippy::as_conversions, clippy::cast_possible_truncation, reason = "within i16")]
            let actual = |cycle: usize| cycle.checked_sub(late).map_or(0, |cycle| filtered[cycle] as i16);
            prop_assert_eq!(fault_by_targets(|cycle| targets[cycle], actual), None);
        }

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
