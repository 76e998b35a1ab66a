//! Soft stops: a spring and a damper return a joint near the end of its range.
//!
//! Each acts on its own joint, which a wrench at the grip could not. Commands are not limited.

use nalgebra::SVector;
use thiserror::Error;

/// Ratio of damping to stiffness at full depth, in s.
const DAMPING_TIME: f64 = 0.02;

/// Soft stops at both ends of `N` joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftStops<const N: usize>([Stop; N]);

#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    range: [f64; 2],
    /// Distance from the ends at which the stop begins, in rad or m.
    margin: f64,
    /// Maximum torque, reached at the ends, in N·m or N.
    push: f64,
}

/// Reason why soft stops are invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidSoftStops {
    /// Margin, as a fraction of the range, not within 0 (excluded) and 0.5.
    #[error("the margin of a soft stop must be above 0 and at most 0.5 of the range, got {0}")]
    Margin(f64),
    /// Push, as a fraction of the joint's capacity, not within 0 and 1.
    #[error("the push of a soft stop must be within 0..=1 of capacity, got {0}")]
    Push(f64),
}

impl<const N: usize> SoftStops<N> {
    /// Creates stops at both ends of `ranges`, in rad or m. `margin` is a fraction of the range, and `push` a fraction of
    /// `max_torques`, the capacities of the joints (not of their actuators).
    ///
    /// # Errors
    /// Returns an error for a margin or push out of range.
    pub fn new(
        ranges: [[f64; 2]; N],
        max_torques: &SVector<f64, N>,
        margin: f64,
        push: f64,
    ) -> Result<Self, InvalidSoftStops> {
        if !(margin > 0.0 && margin <= 0.5) {
            return Err(InvalidSoftStops::Margin(margin));
        }
        if !(0.0..=1.0).contains(&push) {
            return Err(InvalidSoftStops::Push(push));
        }
        let mut stops = [Stop { range: [0.0; 2], margin: 1.0, push: 0.0 }; N];
        for ((stop, range), max) in stops.iter_mut().zip(ranges).zip(max_torques.iter()) {
            let [low, high] = range;
            *stop = Stop { range, margin: (high - low) * margin, push: max * push };
        }
        Ok(Self(stops))
    }

    /// Computes the torques on joints at `q` with rates `qd`, in N·m or N.
    pub fn torques(&self, q: &SVector<f64, N>, qd: &SVector<f64, N>) -> SVector<f64, N> {
        let joints = self.0.iter().zip(q.iter()).zip(qd.iter());
        SVector::from_iterator(joints.map(|((stop, q), qd)| stop.torque(*q, *qd)))
    }
}

impl Stop {
    fn torque(&self, q: f64, qd: f64) -> f64 {
        let [low, high] = self.range;
        let at_high = self.resistance(q - (high - self.margin), qd);
        let at_low = self.resistance(low + self.margin - q, -qd);
        at_low - at_high
    }

    /// Computes the torque against a joint `depth` inside the margin that moves outwards with `speed`. Damping grows with
    /// depth, so the torque has no step, and does not act on a joint that returns.
    fn resistance(&self, depth: f64, speed: f64) -> f64 {
        let inside = (depth / self.margin).clamp(0.0, 1.0);
        let slowed = inside * speed.max(0.0) * DAMPING_TIME / self.margin;
        self.push * (inside + slowed).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MAX: [f64; 2] = [6.0, 0.8];
    const RANGES: [[f64; 2]; 2] = [[-1.0, 2.0], [0.25, 0.6]];

    fn stops() -> SoftStops<2> {
        SoftStops::new(RANGES, &SVector::from(MAX), 0.1, 0.5).unwrap()
    }

    fn torques(q: [f64; 2], qd: [f64; 2]) -> [f64; 2] {
        stops().torques(&SVector::from(q), &SVector::from(qd)).into()
    }

    proptest! {
        #[test]
        fn stop_pushes_inwards_with_at_most_its_fraction(
            q in prop::array::uniform2(-3.0..3.0_f64), qd in prop::array::uniform2(-50.0..50.0_f64)
        ) {
            let middle = RANGES.map(|[low, high]| f64::midpoint(low, high));
            for (joint, tau) in torques(q, qd).into_iter().enumerate() {
                prop_assert!(tau * (q[joint] - middle[joint]) <= 0.0);
                prop_assert!(tau.abs() <= 0.5 * MAX[joint]);
            }
        }

        #[test]
        fn nothing_jumps(q in prop::array::uniform2(-3.0..3.0_f64), qd in prop::array::uniform2(-2.0..2.0_f64)) {
            let near = torques(q.map(|q| q + 1e-7), qd);
            for (tau, near) in torques(q, qd).into_iter().zip(near) {
                prop_assert!((tau - near).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn in_the_middle_a_joint_is_free_at_any_speed() {
        assert!(torques([0.5, 0.4], [20.0, -20.0]).iter().all(|tau| *tau == 0.0));
    }

    #[test]
    fn at_its_end_a_joint_is_pushed_back_with_all_there_is() {
        let [at_high, at_low] = torques([2.0, 0.25], [0.0; 2]);
        assert!((at_high + 3.0).abs() < 1e-12 && (at_low - 0.4).abs() < 1e-12);
    }

    #[test]
    fn a_joint_on_its_way_out_is_slowed_and_on_its_way_back_is_not() {
        let [out, _] = torques([1.9, 0.4], [1.0, 0.0]);
        let [still, _] = torques([1.9, 0.4], [0.0, 0.0]);
        let [back, _] = torques([1.9, 0.4], [-1.0, 0.0]);
        assert!(out < still && (still - back).abs() < 1e-15, "{out} {still} {back}");
    }

    #[test]
    fn parts_are_parts() {
        let with = |margin, push| SoftStops::new(RANGES, &SVector::from(MAX), margin, push);
        for wrong in [-0.1, 1.1, f64::NAN] {
            assert!(with(0.1, wrong).is_err());
            assert!(with(wrong, 0.5).is_err());
        }
        assert!(with(0.0, 0.5).is_err());
    }
}
