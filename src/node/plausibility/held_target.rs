//! Comparison of the target that a drive has taken with the target torques (6071h) that were sent.
//!
//! A drive without an RPDO timer that receives no RPDOs holds its last target indefinitely. The target that it has taken
//! is its target torque (6071h), read by SDO, or its torque demand (6074h), sent by TPDO.
//!
//! A target acts at the SYNC after its cycle. After a lost RPDO the previous target acts a cycle longer, and a sample may be
//! late. A valid value is therefore within the minimum and maximum of the last five targets. The drive reads a reply some
//! time after the request, so targets sent since the request count, too. The range includes the ramp of a drive from one
//! target to the next. Two consecutive values outside of it are a fault.

use crate::cause::Cause;
use config::TAKEN_CYCLES;
use units::drive::PerMille;
use units::numbering::Joint;

/// Number of cycles before a reading whose targets the drive may have applied.
#[expect(clippy::as_conversions, reason = "usize::try_from is not const; it always fits")]
const TARGET_CYCLES: usize = TAKEN_CYCLES as usize;

/// Rounding of a drive that holds its target in another unit, in ‰ of rated torque.
const ROUNDING: i16 = 2;

/// Check of the targets that the drives have taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldTarget {
    /// Ring of the last targets, in ‰ of rated torque.
    targets: [[i16; 6]; TARGET_CYCLES],
    /// Index of the oldest targets.
    oldest: usize,
    /// Range of the targets of each joint that is being read.
    requested: [Option<Range>; 6],
    /// Set if the last value of a joint was outside its range.
    was_off: [bool; 6],
}

/// Minimum and maximum of targets, in ‰ of rated torque.
#[derive(Clone, Copy, Debug)]
struct Range {
    min: i16,
    max: i16,
}

impl Range {
    fn with(self, target: i16) -> Self {
        Self { min: self.min.min(target), max: self.max.max(target) }
    }

    fn contains(self, PerMille(taken): PerMille) -> bool {
        (self.min.saturating_sub(ROUNDING)..=self.max.saturating_add(ROUNDING)).contains(&taken)
    }
}

impl HeldTarget {
    /// Returns a check with all targets zero.
    pub(super) const fn new() -> Self {
        Self {
            targets: [[0; 6]; TARGET_CYCLES],
            oldest: 0,
            requested: [None; 6],
            was_off: [false; 6],
        }
    }

    /// Returns the joints whose last value was outside its range.
    pub(super) const fn was_off(&self) -> [bool; 6] {
        self.was_off
    }

    /// Takes the target torques sent in a cycle, in ‰ of rated torque.
    pub(super) fn on_sent(&mut self, targets: &[i16; 6]) {
        self.targets.iter_mut().skip(self.oldest).take(1).for_each(|oldest| *oldest = *targets);
        self.oldest = (self.oldest + 1) % TARGET_CYCLES;
        for (requested, target) in self.requested.iter_mut().zip(targets) {
            *requested = requested.map(|range| range.with(*target));
        }
    }

    /// Records that the target torque (6071h) of a drive is requested now.
    pub(super) fn on_requested(&mut self, joint: Joint) {
        *joint.entry_mut(&mut self.requested) = Some(self.last_targets(joint));
    }

    /// Checks the reply to a request; `taken` is `None` if it has no value.
    pub(super) fn on_reply(&mut self, joint: Joint, taken: Option<PerMille>) -> Option<Cause> {
        let range = joint.entry_mut(&mut self.requested).take()?;
        self.judge(joint, range, taken?)
    }

    /// Checks the torque demands (6074h) received in this cycle.
    pub(super) fn check(&mut self, demands: &[Option<PerMille>; 6]) -> Option<Cause> {
        let mut cause = None;
        for (joint, demand) in Joint::each(demands) {
            let range = self.last_targets(joint);
            cause = cause.or(demand.and_then(|demand| self.judge(joint, range, demand)));
        }
        cause
    }

    fn judge(&mut self, joint: Joint, range: Range, taken: PerMille) -> Option<Cause> {
        let is_off = !range.contains(taken);
        let was_off = std::mem::replace(joint.entry_mut(&mut self.was_off), is_off);
        (is_off && was_off).then_some(Cause::TargetNotTaken { joint })
    }

    fn last_targets(&self, joint: Joint) -> Range {
        let sent = || self.targets.iter().map(|targets| *joint.entry(targets));
        Range { min: sent().min().unwrap_or(0), max: sent().max().unwrap_or(0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ELBOW: Joint = Joint::of::<3>();
    const NOT_TAKEN: Option<Cause> = Some(Cause::TargetNotTaken { joint: ELBOW });

    /// Sends these targets of the elbow, one in each cycle.
    fn send(check: &mut HeldTarget, targets: impl IntoIterator<Item = i16>) {
        targets.into_iter().for_each(|target| check.on_sent(&[0, 0, target, 0, 0, 0]));
    }

    /// Reads the elbow, which holds `taken`, with the targets of `cycles` sent before the reply.
    fn read(check: &mut HeldTarget, taken: i16, target: i16, cycles: usize) -> Option<Cause> {
        check.on_requested(ELBOW);
        send(check, std::iter::repeat_n(target, cycles));
        check.on_reply(ELBOW, Some(PerMille(taken)))
    }

    #[test]
    fn hazard_13_held_target_is_a_fault_at_the_second_reading() {
        let mut check = HeldTarget::new();
        send(&mut check, [-273; 10]);
        assert_eq!([read(&mut check, -273, -273, 2), read(&mut check, -273, -280, 9)], [None; 2]);
        assert_eq!(read(&mut check, -273, -280, 9), None, "the first");
        assert_eq!(read(&mut check, -273, -280, 9), NOT_TAKEN);
    }

    #[test]
    fn hazard_13_held_demand_is_a_fault_at_the_second_tpdo() {
        let mut check = HeldTarget::new();
        send(&mut check, [100; 20]);
        let demand = [None, None, Some(PerMille(90)), None, None, None];
        assert_eq!([check.check(&demand), check.check(&[None; 6])], [None; 2]);
        assert_eq!(check.check(&demand), NOT_TAKEN);
    }

    #[test]
    fn single_value_outside_is_no_fault() {
        let mut check = HeldTarget::new();
        send(&mut check, [100; 20]);
        for taken in [90, 100, 0, 102, 0, 98] {
            assert_eq!(read(&mut check, taken, 100, 1), None, "{taken}");
        }
    }

    #[test]
    fn promise_14_target_of_any_cycle_of_a_slow_reply_is_no_fault() {
        for taken in 0..40 {
            let mut check = HeldTarget::new();
            send(&mut check, 0..5);
            check.on_requested(ELBOW);
            send(&mut check, 5..40);
            for _ in 0..2 {
                assert_eq!(check.on_reply(ELBOW, Some(PerMille(taken))), None, "{taken}");
            }
        }
    }

    #[test]
    fn unanswered_request_proves_nothing() {
        let mut check = HeldTarget::new();
        send(&mut check, [100; 20]);
        assert_eq!(read(&mut check, 0, 100, 1), None);
        check.on_requested(ELBOW);
        assert_eq!(check.on_reply(ELBOW, None), None);
        assert_eq!(read(&mut check, 0, 100, 1), NOT_TAKEN);
    }
}
