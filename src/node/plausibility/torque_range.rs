//! Range of torques (6077h) that a drive may report after the last target torques (6071h).
//!
//! A target sent in one cycle acts at the next SYNC, and is reached some tenths of a millisecond later. It is sampled at
//! the SYNC after that, and the sample may be late. A drive without a filter therefore reports one of the last five
//! targets.
//!
//! Other drives report through a low pass. Its output y, with a time constant τ ≤ 10 ms, follows its input x by
//! `dy/dt = (x - y) / τ`. The upper end h of the range follows rising inputs at once, and falling ones by
//! `dh/dt = (x - h) / 10 ms`. If y = h > x, y falls at least as fast as h, so y never exceeds h. The same holds for the
//! lower end. After a step of the target the range is 5 % of the step too wide after 30 ms, and 0.3 % after 60 ms.
//!
//! Sensors have relative errors. A drive with an error of 5 %, and 5 % more over temperature by its maker's data, is
//! within 10 % of the larger end. 20 ‰ of rated torque cover all errors that do not depend on torque. They are an offset
//! of the current sensor (1 % of twice the rated current), rounding of target and reading (1 ‰ each), and ripple. Ripple
//! counts only if all readings of 50 ms deviate to one side.

use std::time::Duration;

use units::math;
use units::numbering::Joint;

/// Number of cycles before a reading whose targets the drive may have applied.
pub(super) const TARGET_CYCLES: usize = 5;

/// Longest time constant of a drive's low pass.
const TIME_CONSTANT: Duration = Duration::from_millis(10);

/// Error of a reading as a share of the larger end of the range.
const SHARE: f64 = 0.1;

/// Error of a reading at any torque, in ‰ of rated torque.
const OFFSET: f64 = 20.0;

/// Ranges of all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct TorqueRange {
    /// Ring of the last targets, in ‰ of rated torque.
    targets: [[i16; 6]; TARGET_CYCLES],
    /// Index of the oldest targets.
    oldest: usize,
    /// Lower and upper end of each joint's range before the errors of readings, in ‰ of rated torque.
    ends: [(f64, f64); 6],
    /// Fraction of its distance to the targets by which an end returns per cycle.
    release: f64,
    /// Error of a reading as a share of the larger end.
    share: f64,
    /// Error of a reading at any torque, in ‰ of rated torque.
    offset: f64,
}

impl TorqueRange {
    /// Returns ranges of `tolerance` ‰ of rated torque around the last targets, all zero.
    pub(super) fn within(tolerance: u16) -> Self {
        Self::new(1.0, 0.0, tolerance.into())
    }

    /// Returns ranges that follow the targets, all zero, of cycles of `period`.
    pub(super) fn following(period: Duration) -> Self {
        let release = -math::exp_m1(-period.as_secs_f64() / TIME_CONSTANT.as_secs_f64());
        Self::new(release, SHARE, OFFSET)
    }

    const fn new(release: f64, share: f64, offset: f64) -> Self {
        let targets = [[0; 6]; TARGET_CYCLES];
        Self { targets, oldest: 0, ends: [(0.0, 0.0); 6], release, share, offset }
    }

    /// Takes the target torques sent in a cycle, in ‰ of rated torque.
    pub(super) fn on_sent(&mut self, targets: &[i16; 6]) {
        self.targets.iter_mut().skip(self.oldest).take(1).for_each(|oldest| *oldest = *targets);
        self.oldest = (self.oldest + 1) % TARGET_CYCLES;
        for joint in Joint::ALL {
            let (min, max) = self.last_targets(joint);
            let (low, high) = joint.entry_mut(&mut self.ends);
            *low = min.min(*low + self.release * (min - *low));
            *high = max.max(*high + self.release * (max - *high));
        }
    }

    /// Returns whether a drive may report this torque, in ‰ of rated torque.
    pub(super) fn contains(&self, joint: Joint, actual: i16) -> bool {
        self.is_within(*joint.entry(&self.ends), actual)
    }

    /// Returns whether a drive without a low pass may report this torque, in ‰ of rated torque.
    pub(super) fn contains_at_once(&self, joint: Joint, actual: i16) -> bool {
        self.is_within(self.last_targets(joint), actual)
    }

    /// Returns the minimum and maximum of a joint's last targets.
    fn last_targets(&self, joint: Joint) -> (f64, f64) {
        let sent = || self.targets.iter().map(|targets| *joint.entry(targets));
        let [min, max] = [sent().min(), sent().max()].map(|end| f64::from(end.unwrap_or(0)));
        (min, max)
    }

    fn is_within(&self, (low, high): (f64, f64), actual: i16) -> bool {
        let error = self.share * low.abs().max(high.abs()) + self.offset;
        (low - error..=high + error).contains(&f64::from(actual))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ELBOW: Joint = Joint::of::<3>();

    #[test]
    fn range_shrinks_to_a_new_target_within_60_ms() {
        let mut range = TorqueRange::following(Duration::from_millis(1));
        let send = |range: &mut TorqueRange, target, cycles| {
            (0..cycles).for_each(|_| range.on_sent(&[0, 0, target, 0, 0, 0]));
        };
        send(&mut range, 400, 10);
        assert!(range.contains(ELBOW, 150) && !range.contains_at_once(ELBOW, 150));
        send(&mut range, 400, 60);
        assert!(range.contains(ELBOW, 340) && !range.contains(ELBOW, 335));
        assert!(range.contains(ELBOW, 459) && !range.contains(ELBOW, 461));
        send(&mut range, 0, 60);
        assert!(range.contains(ELBOW, 20) && !range.contains(ELBOW, 24));
        send(&mut range, 400, 1);
        send(&mut range, 0, 5);
        assert!(range.contains(ELBOW, 60) && !range.contains_at_once(ELBOW, 60));
    }
}
