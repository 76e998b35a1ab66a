//! Whether a joint's position stands still to the last count although the joint cannot.
//!
//! A joint that nothing pushes, or that its friction holds, does stand still: an arm whose weight is carried
//! with exactly that torque, with nobody's hand on it, for ever. It is suspicious only if all of this holds
//! for as long as it may last:
//!
//! - it is pushed, with more than a fifth of rated torque;
//! - that torque has changed by more than a tenth of rated torque, which is several times what dry friction
//!   can take up, and which a hand could take up only by giving way;
//! - a joint next to it has moved clearly, by more than a hand at rest trembles.
//!
//! So an encoder that freezes while its joint is not pushed is not seen, until it is.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::sampled::Sampled;
use units::drive::Counts;
use units::numbering::Joint;
use units::time::Instant;

/// A torque that pushes, in ‰ of rated torque.
const PUSHES: u16 = 200;

/// A change of torque that moves, in ‰ of rated torque.
const CHANGES: u16 = 100;

/// The watch on all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frozen {
    lasting: Duration,
    /// What is a clear motion, in counts.
    clear: [u32; 6],
    still: [Option<Still>; 6],
}

/// A joint that stands still.
#[derive(Clone, Copy, Debug)]
struct Still {
    since: Instant,
    /// Where all joints were then.
    from: [Counts; 6],
    /// The least and the most it was told since.
    told: [i16; 2],
    /// Whether a neighbour has moved.
    beside_motion: bool,
}

impl Frozen {
    /// Position may stand still for `lasting`; `clear` is a clear motion of each joint, in counts.
    pub(super) const fn new(lasting: Duration, clear: [u32; 6]) -> Self {
        Self { lasting, clear, still: [None; 6] }
    }

    /// The weight of the arm is laid down: its torque changes, and friction may hold the joint all the same.
    pub(super) const fn forget(&mut self) {
        self.still = [None; 6];
    }

    /// Takes this cycle's samples, and the target torques that acted until then, in ‰ of rated torque.
    pub(super) fn judge(&mut self, sampled: &Sampled<'_>, told: &[i16; 6]) -> Option<Cause> {
        let positions = sampled.latest.map(|sample| sample.position);
        let clear = self.clear;
        let mut frozen = None;
        for (joint, (still, told)) in Joint::each(self.still.iter_mut().zip(told)) {
            if !joint.entry(&sampled.fresh) {
                continue;
            }
            let now = joint.entry(&positions);
            let still = match still {
                Some(still) if joint.entry(&still.from) == now => still,
                moved => moved.insert(Still::since(sampled.at, positions, *told)),
            };
            still.follow(joint, &positions, &clear, *told);
            if sampled.at.since(still.since) >= self.lasting && still.is_impossible(*told) {
                frozen = frozen.or(Some(Cause::PositionFrozen { joint }));
            }
        }
        frozen
    }
}

impl Still {
    const fn since(at: Instant, from: [Counts; 6], told: i16) -> Self {
        Self { since: at, from, told: [told; 2], beside_motion: false }
    }

    fn follow(&mut self, joint: Joint, now: &[Counts; 6], clear: &[u32; 6], told: i16) {
        let [least, most] = self.told;
        self.told = [least.min(told), most.max(told)];
        let joints = Joint::each(self.from.iter().zip(now).zip(clear));
        let mut beside = joints.filter(|(other, _)| other.number().abs_diff(joint.number()) == 1);
        self.beside_motion |= beside
            .any(|(_, ((from, now), clear))| now.0.wrapping_sub(from.0).unsigned_abs() > *clear);
    }

    fn is_impossible(&self, told: i16) -> bool {
        let [least, most] = self.told;
        self.beside_motion && told.unsigned_abs() > PUSHES && most.abs_diff(least) > CHANGES
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::pdo::DriveSample;

    /// What is told of the third of three joints that move otherwise, at which cycle of a millisecond.
    fn told(
        position: impl Fn(i32) -> i32,
        beside: impl Fn(i32) -> i32,
        torque: impl Fn(i32) -> i16,
    ) -> Option<i32> {
        let mut frozen = Frozen::new(Duration::from_millis(500), [100; 6]);
        (0..2_000).find(|&cycle| {
            let at = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            let counts = [0, beside(cycle), position(cycle), 0, 0, 0];
            let latest = counts
                .map(|counts| DriveSample { position: Counts(counts), ..DriveSample::default() });
            let sampled = Sampled { at, latest: &latest, fresh: [true; 6], torques: [false; 6] };
            let cause = frozen.judge(&sampled, &[0, 0, torque(cycle), 0, 0, 0]);
            assert!(
                cause
                    .is_none_or(|cause| cause == Cause::PositionFrozen { joint: Joint::of::<3>() })
            );
            cause.is_some()
        })
    }

    const fn swinging(cycle: i32) -> i16 {
        if cycle % 100 < 50 { 250 } else { 360 }
    }

    #[test]
    fn hazard_05_a_position_that_stands_still_under_a_changing_torque_is_told_in_half_a_second() {
        assert_eq!(told(|_| 7, |cycle| cycle, swinging), Some(500));
        assert_eq!(told(|_| 7, |cycle| cycle, |cycle| -swinging(cycle)), Some(500));
    }

    #[test]
    fn hazard_05_what_a_hand_or_friction_may_hold_is_not_told() {
        assert_eq!(told(|cycle| cycle / 400, |cycle| cycle, swinging), None, "it moves");
        assert_eq!(told(|_| 7, |cycle| cycle % 100, swinging), None, "its neighbour trembles");
        assert_eq!(told(|_| 7, |cycle| cycle, |_| 900), None, "its weight is carried");
        assert_eq!(told(|_| 7, |cycle| cycle, |cycle| swinging(cycle) - 200), None, "no push");
    }

    /// The same of joint 3, if this other joint moves so.
    fn told_beside(other: Joint, moves: impl Fn(i32) -> i32) -> Option<i32> {
        let mut frozen = Frozen::new(Duration::from_millis(500), [100; 6]);
        (0..2_000).find(|&cycle| {
            let at = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            let mut latest = [DriveSample::default(); 6];
            other.entry_mut(&mut latest).position = Counts(moves(cycle));
            let sampled = Sampled { at, latest: &latest, fresh: [true; 6], torques: [false; 6] };
            frozen.judge(&sampled, &[0, 0, swinging(cycle), 0, 0, 0]).is_some()
        })
    }

    #[test]
    fn hazard_05_only_the_joints_next_to_it_are_neighbours() {
        for (other, told) in Joint::each([None, Some(500), None, Some(500), None, None]) {
            if other != Joint::of::<3>() {
                assert_eq!(told_beside(other, |cycle| cycle), told, "joint {other}");
            }
        }
    }

    #[test]
    fn property_14_neighbour_that_wraps_has_hardly_moved() {
        let trembles = |cycle: i32| i32::MAX.wrapping_add(cycle % 90 - 45);
        assert_eq!(told_beside(Joint::of::<4>(), trembles), None);
    }

    #[test]
    fn what_was_before_it_stood_still_does_not_count() {
        let torque = |cycle| if cycle < 900 { swinging(cycle) } else { 300 };
        assert_eq!(told(|cycle| cycle.min(900), |cycle| cycle, torque), None);
    }
}
