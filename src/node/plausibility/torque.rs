//! Whether a drive exerts the torque it is told.
//!
//! A torque told in one cycle acts at the SYNC of the next, is reached some tenths of a millisecond later, and
//! is in a sample of the SYNC after that, which may be late. So a reading is compared with all that was told
//! in the last cycles: it must lie between the least and the most of it, give or take the tolerance. That
//! needs no model of the current loop, and no reading is judged by a torque that is older or newer than it
//! can be.
//!
//! It differs if every reading does for as long as it may last: two of them at least. Where torque is told
//! at every hundredth SYNC only, that is the second reading: 107 to 214 cycles, instead of 50.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::sampled::Sampled;
use units::numbering::Joint;
use units::time::Instant;

/// Cycles in which what is read may have been told.
const DEPTH: usize = 5;

/// The watch on all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Torque {
    /// In ‰ of rated torque.
    tolerance: i32,
    lasting: Duration,
    /// What was told in the last cycles, in ‰ of rated torque; the newest is anywhere.
    told: [[i16; 6]; DEPTH],
    oldest: usize,
    /// Since when all readings differ.
    since: [Option<Instant>; 6],
}

impl Torque {
    /// A torque may be off by `tolerance`, in ‰ of rated torque, and by more for less than `lasting`.
    pub(super) const fn new(tolerance: u16, lasting: Duration) -> Self {
        let told = [[0; 6]; DEPTH];
        #[expect(clippy::as_conversions, reason = "i32::from is not const; it always fits")]
        let tolerance = tolerance as i32;
        Self { tolerance, lasting, told, oldest: 0, since: [None; 6] }
    }

    /// The drives are told these torques, in ‰ of rated torque.
    pub(super) fn tell(&mut self, targets: &[i16; 6]) {
        self.told.iter_mut().skip(self.oldest).take(1).for_each(|told| *told = *targets);
        self.oldest = (self.oldest + 1) % DEPTH;
    }

    /// Takes what the drives said of their torques in this cycle, if they did.
    pub(super) fn judge(&mut self, sampled: &Sampled<'_>) -> Option<Cause> {
        let mut differs = None;
        let readings = sampled.latest.iter().zip(sampled.torques);
        for (joint, (sample, _)) in Joint::each(readings).filter(|(_, (_, is_read))| *is_read) {
            let is_off = self.is_off(joint, i32::from(sample.torque.0));
            let since = joint.entry_mut(&mut self.since);
            *since = if is_off { since.or(Some(sampled.at)) } else { None };
            let lasts = since.map(|since| sampled.at.since(since));
            if lasts.is_some_and(|lasts| lasts >= self.lasting) {
                differs = differs.or(Some(Cause::TorqueDiffers { joint }));
            }
        }
        differs
    }

    /// Whether a joint's reading is off all it was told lately.
    fn is_off(&self, joint: Joint, actual: i32) -> bool {
        let told = || self.told.iter().map(|told| i32::from(*joint.entry(told)));
        let least = told().min().unwrap_or(0).saturating_sub(self.tolerance);
        let most = told().max().unwrap_or(0).saturating_add(self.tolerance);
        !(least..=most).contains(&actual)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::pdo::DriveSample;
    use units::drive::PerMille;

    /// At which cycle of a millisecond it is told, if the elbow reads `actual` at every `every`th.
    fn told(
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
            let cause = torque.judge(&sampled);
            torque.tell(&[0, 0, target(cycle), 0, 0, 0]);
            assert!(
                cause.is_none_or(|cause| cause == Cause::TorqueDiffers { joint: Joint::of::<3>() })
            );
            cause.is_some()
        })
    }

    #[test]
    fn hazard_10_half_the_torque_is_told_after_50_ms_or_at_the_second_reading() {
        let half_from = |begin| move |cycle| if cycle < begin { 400 } else { 200 };
        assert_eq!(told(1, |_| 400, half_from(200)), Some(250));
        assert_eq!(told(107, |_| 400, half_from(215)), Some(428), "read at 321 and 428");
    }

    #[test]
    fn hazard_10_a_difference_within_the_tolerance_or_soon_over_is_not_told() {
        assert_eq!(told(1, |_| 400, |_| 251), None);
        assert_eq!(told(1, |_| 400, |cycle| if cycle % 60 < 50 { 0 } else { 400 }), None);
    }

    #[test]
    fn a_torque_that_nobody_asked_for_is_told() {
        assert_eq!(told(1, |_| 0, |cycle| if cycle < 100 { 0 } else { -300 }), Some(150));
    }

    proptest! {
        /// Up to four cycles from being told to being read, however the torque changes.
        #[test]
        fn promise_14_what_is_read_late_is_what_was_told(
            targets in prop::collection::vec(any::<i16>(), 1_000), late in 1..=DEPTH, every in 1..120_usize
        ) {
            let actual = |cycle: usize| cycle.checked_sub(late).map_or(0, |cycle| targets[cycle]);
            prop_assert_eq!(told(every, |cycle| targets[cycle], actual), None);
        }
    }
}
