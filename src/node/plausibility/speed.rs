//! Whether joints and grip move no faster than they may.
//!
//! By difference, between cycles in which every joint was sampled: where one is missing, neither the grip's
//! pose nor a coupled joint's position is one of a single moment. Twice in a row is too fast; once may be a
//! late sample, which puts the motion of two cycles into one. And over both together it must be too fast as well: a
//! single wrong sample goes away and comes back.

use std::time::Duration;

use nalgebra::Vector3;

use crate::cause::Cause;
use controller::JointVector;
use units::numbering::Joint;
use units::time::Instant;

/// The most that is allowed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Most {
    /// Of each joint, in rad/s or m/s.
    pub(super) joints: [f64; 6],
    /// Of the grip, in m/s.
    pub(super) grip: f64,
}

/// The watch on all joints and the grip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Speed {
    most: Most,
    /// No two SYNCs are nearer to each other.
    nearest: Duration,
    /// The newest first.
    last: [Option<Moment>; 2],
    /// Whether joints, and the grip, were too fast the last time.
    joints: [bool; 6],
    grip: bool,
}

/// Where everything was.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    /// When.
    pub(super) at: Instant,
    /// Joint positions, in rad or m.
    pub(super) q: JointVector,
    /// The grip's position, in m.
    pub(super) p_0_g: Vector3<f64>,
}

impl Speed {
    /// At rest, with one SYNC every `period`.
    pub(super) const fn new(most: Most, period: Duration) -> Self {
        Self { most, nearest: period, last: [None; 2], joints: [false; 6], grip: false }
    }

    /// Takes where everything is now, in a cycle in which every joint was sampled.
    pub(super) fn judge(&mut self, now: &Moment) -> Option<Cause> {
        let [last, before] = self.last;
        self.last = [Some(*now), last];
        let last = last?;
        // A SYNC may be late by half a period, and the next one in time.
        let one = now.rates(&last, self.nearest / 2);
        let both = now.rates(&before.unwrap_or(last), self.nearest);
        let mut cause = None;
        let joints = Joint::each(&mut self.joints).zip(one.qd.iter().zip(both.qd.iter()));
        for (((joint, was), (one, both)), most) in joints.zip(self.most.joints) {
            let is_repeated = is_twice(was, is_above(one.abs(), most));
            if is_repeated && is_above(both.abs(), most) {
                cause = cause.or(Some(Cause::Overspeed { joint }));
            }
        }
        let most = self.most.grip;
        let is_repeated = is_twice(&mut self.grip, is_above(one.v_g_in_0, most));
        let grip = is_repeated && is_above(both.v_g_in_0, most);
        cause.or(grip.then_some(Cause::GripOverspeed))
    }
}

/// How fast everything has come from one moment to another.
#[derive(Clone, Copy, Debug)]
struct Rates {
    /// Of the joints, in rad/s or m/s.
    qd: JointVector,
    /// Of the grip, in m/s.
    v_g_in_0: f64,
}

impl Moment {
    /// From `before`, at least `shortest` ago.
    fn rates(&self, before: &Self, shortest: Duration) -> Rates {
        let dt = self.at.since(before.at).max(shortest).as_secs_f64();
        Rates { qd: (self.q - before.q) / dt, v_g_in_0: (self.p_0_g - before.p_0_g).norm() / dt }
    }
}

/// Whether it is so now and was so the last time.
const fn is_twice(was: &mut bool, is: bool) -> bool {
    std::mem::replace(was, is) && is
}

/// A number that is none is above everything.
fn is_above(value: f64, most: f64) -> bool {
    value > most || value.is_nan()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const T: Duration = Duration::from_millis(1);

    fn speed() -> Speed {
        Speed::new(Most { joints: [6.0; 6], grip: 1.0 }, T)
    }

    /// What is told of an elbow and a grip that are there at these cycles.
    fn told(moments: impl IntoIterator<Item = (u64, f64, f64)>) -> Vec<Option<Cause>> {
        let mut speed = speed();
        let judge = |(cycle, q, x): (u64, f64, f64)| {
            let at = Instant::from_micros(1_000 * cycle);
            let q = JointVector::from([0.0, 0.0, q, 0.0, 0.0, 0.0]);
            speed.judge(&Moment { at, q, p_0_g: Vector3::new(0.0, x, 0.0) })
        };
        moments.into_iter().map(judge).collect()
    }

    #[test]
    fn hazard_11_a_joint_too_fast_twice_is_told_in_the_second_sample() {
        let at = |cycle: u32| (u64::from(cycle), 6.1e-3 * f64::from(cycle), 0.0);
        let joint = Some(Cause::Overspeed { joint: Joint::of::<3>() });
        assert_eq!(told((0..4).map(at)), [None, None, joint, joint]);
        assert_eq!(told([(0, 0.0, 0.0), (1, -0.1, 0.0), (2, -0.2, 0.0)])[2], joint, "either way");
    }

    #[test]
    fn hazard_11_a_grip_faster_than_a_metre_in_a_second_is_told() {
        let at = |cycle: u32| (u64::from(cycle), 0.0, 1.01e-3 * f64::from(cycle));
        assert_eq!(told((0..3).map(at))[2], Some(Cause::GripOverspeed));
    }

    #[test]
    fn hazard_04_the_motion_of_two_cycles_in_one_is_not_too_fast() {
        // At 5 rad/s. The sample of 2 is missing, that of 3 is the one of 2, late.
        let late = [(1, 0.005, 0.0), (3, 0.010, 0.0), (4, 0.020, 0.0), (5, 0.025, 0.0)];
        assert_eq!(told(late), [None; 4]);
    }

    #[test]
    fn single_wrong_sample_of_any_size_is_not_too_fast() {
        for (wrong, grip) in [(0.01, 0.0), (-3.0, 0.0), (0.0, 0.002), (0.0, -0.5), (1e3, 1e3)] {
            let there =
                [(0, 0.0, 0.0), (1, 0.0, 0.0), (2, wrong, grip), (3, 0.0, 0.0), (4, 0.0, 0.0)];
            assert_eq!(told(there), [None; 5], "{wrong} rad, {grip} m");
        }
    }

    #[test]
    fn a_number_that_is_none_is_too_fast() {
        let none = [(0, 0.0, 0.0), (1, f64::NAN, 0.0), (2, f64::NAN, 0.0)];
        assert_eq!(told(none)[2], Some(Cause::Overspeed { joint: Joint::of::<3>() }));
    }

    proptest! {
        #[test]
        fn promise_14_what_is_slow_enough_is_never_told(
            motions in prop::collection::vec((-5.9e-3..5.9e-3_f64, -0.99e-3..0.99e-3_f64, 1..4_u64), 1..99)
        ) {
            let (mut cycle, mut q, mut x) = (0, 0.0, 0.0);
            let moments = motions.into_iter().map(|(dq, dx, cycles)| {
                (cycle, q, x) = (cycle + cycles, q + dq, x + dx);
                (cycle, q, x)
            });
            prop_assert!(told(moments).iter().all(Option::is_none));
        }
    }
}
