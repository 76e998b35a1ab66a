//! Detection of frozen encoders: a position constant to the last count although the joint must move.
//!
//! A joint without load, or held by friction, can remain at a constant position indefinitely. A constant position is a
//! fault only if all of these conditions hold for its time:
//!
//! - The target torque exceeds a fifth of rated torque.
//! - It has changed by more than a tenth of rated torque. That is several times the dry friction, and more than a hand
//!   resists without yielding.
//! - An adjacent joint has moved clearly, by more than the tremor of a resting hand.
//!
//! A frozen encoder of an unloaded joint therefore stays undetected until the joint is loaded.
//!
//! While gravity compensation ramps up, torque changes without motion: a cradle or the hand hands the weight over, and friction
//! may hold the joint. That change does not count.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::sample_set::SampleSet;
use units::drive::Counts;
use units::numbering::Joint;
use units::time::Instant;

/// Minimum magnitude of a target torque that loads a joint, in ‰ of rated torque.
const MIN_TORQUE: u16 = 200;

/// Minimum change of target torque that moves a joint, in ‰ of rated torque.
const MIN_TORQUE_CHANGE: u16 = 100;

/// State of gravity compensation, whose ramps change a joint's torque without motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    /// Off, or ramping down.
    NotCarried,
    /// Ramping up.
    TakenOver,
    /// Full.
    Carried,
}

/// Frozen-encoder detection of all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frozen {
    /// Time for which a position may be constant.
    timeout: Duration,
    /// Clear motion of each joint, in counts.
    clear: [u32; 6],
    standstill: [Option<Standstill>; 6],
}

/// Standstill of a joint.
#[derive(Clone, Copy, Debug)]
struct Standstill {
    since: Instant,
    /// Positions of all joints at its start.
    from: [Counts; 6],
    /// Minimum and maximum target torque since then, in ‰ of rated torque.
    torque_range: [i16; 2],
    /// An adjacent joint has moved clearly since then.
    neighbour_moved: bool,
}

impl Frozen {
    /// Returns a detector before the first sample. Positions may be constant for `timeout`; `clear` is a clear motion of
    /// each joint, in counts.
    pub(super) const fn new(timeout: Duration, clear: [u32; 6]) -> Self {
        Self { timeout, clear, standstill: [None; 6] }
    }

    /// Checks the samples of a cycle. `targets` acted until its SYNC, in ‰ of rated torque.
    pub(super) fn check(
        &mut self,
        sampled: &SampleSet<'_>,
        targets: &[i16; 6],
        weight: Weight,
    ) -> Option<Cause> {
        let positions = sampled.latest.map(|sample| sample.position);
        let clear = self.clear;
        let mut frozen = None;
        for (joint, (standstill, target)) in Joint::each(self.standstill.iter_mut().zip(targets)) {
            if !joint.entry(&sampled.fresh) {
                continue;
            }
            let now = joint.entry(&positions);
            let standstill = match standstill {
                Some(standstill)
                    if joint.entry(&standstill.from) == now && weight != Weight::NotCarried =>
                {
                    standstill
                }
                moved => moved.insert(Standstill::new(sampled.at, positions, *target)),
            };
            if weight == Weight::TakenOver {
                standstill.torque_range = [*target; 2];
            }
            standstill.update(joint, &positions, &clear, *target);
            let has_timed_out = sampled.at.since(standstill.since) >= self.timeout;
            if has_timed_out && standstill.is_implausible(*target) {
                frozen = frozen.or(Some(Cause::PositionFrozen { joint }));
            }
        }
        frozen
    }
}

impl Standstill {
    const fn new(since: Instant, from: [Counts; 6], target: i16) -> Self {
        Self { since, from, torque_range: [target; 2], neighbour_moved: false }
    }

    fn update(&mut self, joint: Joint, now: &[Counts; 6], clear: &[u32; 6], target: i16) {
        let [min, max] = self.torque_range;
        self.torque_range = [min.min(target), max.max(target)];
        let joints = Joint::each(self.from.iter().zip(now).zip(clear));
        let mut adjacent = joints.filter(|(other, _)| other.number().abs_diff(joint.number()) == 1);
        self.neighbour_moved |= adjacent
            .any(|(_, ((from, now), clear))| now.0.wrapping_sub(from.0).unsigned_abs() > *clear);
    }

    fn is_implausible(&self, target: i16) -> bool {
        let [min, max] = self.torque_range;
        let is_loaded = target.unsigned_abs() > MIN_TORQUE;
        self.neighbour_moved && is_loaded && max.abs_diff(min) > MIN_TORQUE_CHANGE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::pdo::DriveSample;

    /// Returns the cycle of 1 ms of the fault of joint 3. `adjacent` is the position of joint 2.
    fn fault_cycle(
        position: impl Fn(i32) -> i32,
        adjacent: impl Fn(i32) -> i32,
        torque: impl Fn(i32) -> i16,
    ) -> Option<i32> {
        let mut frozen = Frozen::new(Duration::from_millis(500), [100; 6]);
        (0..2_000).find(|&cycle| {
            let at = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            let counts = [0, adjacent(cycle), position(cycle), 0, 0, 0];
            let latest = counts
                .map(|counts| DriveSample { position: Counts(counts), ..DriveSample::default() });
            let (torques, demands) = ([false; 6], [None; 6]);
            let sampled = SampleSet { at, latest: &latest, fresh: [true; 6], torques, demands };
            let cause = frozen.check(&sampled, &[0, 0, torque(cycle), 0, 0, 0], Weight::Carried);
            assert!(
                cause
                    .is_none_or(|cause| cause == Cause::PositionFrozen { joint: Joint::of::<3>() })
            );
            cause.is_some()
        })
    }

    const fn changing(cycle: i32) -> i16 {
        if cycle % 100 < 50 { 250 } else { 360 }
    }

    #[test]
    fn hazard_05_position_constant_under_torque_trips_in_500_ms() {
        assert_eq!(fault_cycle(|_| 7, |cycle| cycle, changing), Some(500));
        assert_eq!(fault_cycle(|_| 7, |cycle| cycle, |cycle| -changing(cycle)), Some(500));
    }

    #[test]
    fn hazard_05_joint_held_by_hand_or_friction_is_no_fault() {
        assert_eq!(fault_cycle(|cycle| cycle / 400, |cycle| cycle, changing), None, "it moves");
        assert_eq!(
            fault_cycle(|_| 7, |cycle| cycle % 100, changing),
            None,
            "its neighbour has tremor"
        );
        assert_eq!(fault_cycle(|_| 7, |cycle| cycle, |_| 900), None, "its weight is carried");
        assert_eq!(
            fault_cycle(|_| 7, |cycle| cycle, |cycle| changing(cycle) - 200),
            None,
            "no load"
        );
    }

    /// Returns the cycle of 1 ms of the fault of joint 3. `position` is that of the joint `other`.
    fn fault_cycle_beside(other: Joint, position: impl Fn(i32) -> i32) -> Option<i32> {
        let mut frozen = Frozen::new(Duration::from_millis(500), [100; 6]);
        (0..2_000).find(|&cycle| {
            let at = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            let mut latest = [DriveSample::default(); 6];
            other.entry_mut(&mut latest).position = Counts(position(cycle));
            let (torques, demands) = ([false; 6], [None; 6]);
            let sampled = SampleSet { at, latest: &latest, fresh: [true; 6], torques, demands };
            frozen.check(&sampled, &[0, 0, changing(cycle), 0, 0, 0], Weight::Carried).is_some()
        })
    }

    #[test]
    fn hazard_05_motion_counts_of_adjacent_joints_only() {
        for (other, expected) in Joint::each([None, Some(500), None, Some(500), None, None]) {
            if other != Joint::of::<3>() {
                assert_eq!(fault_cycle_beside(other, |cycle| cycle), expected, "joint {other}");
            }
        }
    }

    #[test]
    fn property_14_wrap_of_an_adjacent_joint_is_a_small_motion() {
        let tremor = |cycle: i32| i32::MAX.wrapping_add(cycle % 90 - 45);
        assert_eq!(fault_cycle_beside(Joint::of::<4>(), tremor), None);
    }

    #[test]
    fn torque_before_the_standstill_does_not_count() {
        let torque = |cycle| if cycle < 900 { changing(cycle) } else { 300 };
        assert_eq!(fault_cycle(|cycle| cycle.min(900), |cycle| cycle, torque), None);
    }

    /// Returns the cycle of 1 ms of the fault of joint 3, which stands still: its torque rises to `full` until cycle 1,000
    /// while its weight is taken over, and by `more` afterwards.
    fn fault_cycle_in_ramp(full: i32, more: i32) -> Option<i32> {
        let mut frozen = Frozen::new(Duration::from_millis(500), [100; 6]);
        (0..2_000).find(|&cycle| {
            let at = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            let mut latest = [DriveSample::default(); 6];
            latest[1].position = Counts(cycle);
            let (torques, demands) = ([false; 6], [None; 6]);
            let sampled = SampleSet { at, latest: &latest, fresh: [true; 6], torques, demands };
            let weight = if cycle < 1_000 { Weight::TakenOver } else { Weight::Carried };
            let torque = full * cycle.min(1_000) / 1_000 + more * (cycle - 1_000).max(0) / 1_000;
            let targets = [0, 0, i16::try_from(torque).unwrap(), 0, 0, 0];
            frozen.check(&sampled, &targets, weight).is_some()
        })
    }

    #[test]
    fn hazard_05_torque_of_the_ramp_does_not_count() {
        assert_eq!(fault_cycle_in_ramp(500, 0), None);
        assert_eq!(fault_cycle_in_ramp(500, 500), Some(1_200), "a tenth more since the ramp");
    }
}
