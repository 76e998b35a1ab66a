//! Speed limits of joints and grip.
//!
//! Speeds are differences between cycles with a sample of every joint. With a sample missing, the pose of the grip and
//! the positions of coupled joints would mix two times. A fault requires two consecutive excesses, because a late sample
//! puts the motion of two cycles into one. The speed over both intervals must exceed the limit, too, because a single
//! wrong sample steps away and back.

use std::time::Duration;

use nalgebra::Vector3;

use crate::cause::Cause;
use controller::JointVector;
use units::numbering::Joint;
use units::time::Instant;

/// Maximum speeds.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedLimits {
    /// Maximum speed of each joint, in rad/s or m/s.
    pub(super) joints: [f64; 6],
    /// Maximum speed of the grip, in m/s.
    pub(super) grip: f64,
}

/// Speed check of all joints and the grip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Speed {
    limits: SpeedLimits,
    /// SYNC period, the minimum time between two cycles.
    period: Duration,
    /// Last two cycles, the newest first.
    last: [Option<Snapshot>; 2],
    /// Joints above their limit in the last interval.
    joints_above: [bool; 6],
    /// Grip above its limit in the last interval.
    grip_above: bool,
}

/// Positions of one cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Snapshot {
    /// Time of its SYNC.
    pub(super) at: Instant,
    /// Joint positions, in rad or m.
    pub(super) q: JointVector,
    /// Position of the grip, in m.
    pub(super) p_0_g: Vector3<f64>,
}

impl Speed {
    /// Returns a check before the first sample, with one SYNC every `period`.
    pub(super) const fn new(limits: SpeedLimits, period: Duration) -> Self {
        Self { limits, period, last: [None; 2], joints_above: [false; 6], grip_above: false }
    }

    /// Checks a cycle with a sample of every joint.
    pub(super) fn check(&mut self, now: &Snapshot) -> Option<Cause> {
        let [last, before] = self.last;
        self.last = [Some(*now), last];
        let last = last?;
        // A SYNC may be late by half a period, and the next one on time.
        let one = now.speeds(&last, self.period / 2);
        let both = now.speeds(&before.unwrap_or(last), self.period);
        let mut cause = None;
        let joints = Joint::each(&mut self.joints_above).zip(one.qd.iter().zip(both.qd.iter()));
        for (((joint, was_above), (one, both)), max) in joints.zip(self.limits.joints) {
            let is_repeated = is_repeated(was_above, exceeds(one.abs(), max));
            if is_repeated && exceeds(both.abs(), max) {
                cause = cause.or(Some(Cause::Overspeed { joint }));
            }
        }
        let max = self.limits.grip;
        let is_repeated = is_repeated(&mut self.grip_above, exceeds(one.v_g_in_0, max));
        let grip = is_repeated && exceeds(both.v_g_in_0, max);
        cause.or(grip.then_some(Cause::GripOverspeed))
    }
}

/// Mean speeds between two cycles.
#[derive(Clone, Copy, Debug)]
struct Speeds {
    /// Joint velocities, in rad/s or m/s.
    qd: JointVector,
    /// Speed of the grip, in m/s.
    v_g_in_0: f64,
}

impl Snapshot {
    /// Returns the mean speeds since `before`, at least `min_dt` ago.
    fn speeds(&self, before: &Self, min_dt: Duration) -> Speeds {
        let dt = self.at.since(before.at).max(min_dt).as_secs_f64();
        Speeds { qd: (self.q - before.q) / dt, v_g_in_0: (self.p_0_g - before.p_0_g).norm() / dt }
    }
}

/// Stores `is` in `was`, and returns whether both were set.
const fn is_repeated(was: &mut bool, is: bool) -> bool {
    std::mem::replace(was, is) && is
}

/// Returns whether `value` is above `max`, or NaN.
fn exceeds(value: f64, max: f64) -> bool {
    value > max || value.is_nan()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const T: Duration = Duration::from_millis(1);

    fn speed() -> Speed {
        Speed::new(SpeedLimits { joints: [6.0; 6], grip: 1.0 }, T)
    }

    /// Returns the cause of each cycle. A snapshot is the cycle, the elbow's position and the grip's.
    fn causes(snapshots: impl IntoIterator<Item = (u64, f64, f64)>) -> Vec<Option<Cause>> {
        let mut speed = speed();
        let check = |(cycle, q, x): (u64, f64, f64)| {
            let at = Instant::from_micros(1_000 * cycle);
            let q = JointVector::from([0.0, 0.0, q, 0.0, 0.0, 0.0]);
            speed.check(&Snapshot { at, q, p_0_g: Vector3::new(0.0, x, 0.0) })
        };
        snapshots.into_iter().map(check).collect()
    }

    #[test]
    fn hazard_11_joint_too_fast_twice_is_a_fault() {
        let at = |cycle: u32| (u64::from(cycle), 6.1e-3 * f64::from(cycle), 0.0);
        let joint = Some(Cause::Overspeed { joint: Joint::of::<3>() });
        assert_eq!(causes((0..4).map(at)), [None, None, joint, joint]);
        assert_eq!(causes([(0, 0.0, 0.0), (1, -0.1, 0.0), (2, -0.2, 0.0)])[2], joint, "either way");
    }

    #[test]
    fn hazard_11_grip_faster_than_1_m_per_s_is_a_fault() {
        let at = |cycle: u32| (u64::from(cycle), 0.0, 1.01e-3 * f64::from(cycle));
        assert_eq!(causes((0..3).map(at))[2], Some(Cause::GripOverspeed));
    }

    #[test]
    fn hazard_04_late_sample_in_motion_is_not_too_fast() {
        // At 5 rad/s. Cycle 2 has no sample; cycle 3 has that of 2, late.
        let late = [(1, 0.005, 0.0), (3, 0.010, 0.0), (4, 0.020, 0.0), (5, 0.025, 0.0)];
        assert_eq!(causes(late), [None; 4]);
    }

    #[test]
    fn single_wrong_sample_of_any_size_is_not_too_fast() {
        for (wrong, grip) in [(0.01, 0.0), (-3.0, 0.0), (0.0, 0.002), (0.0, -0.5), (1e3, 1e3)] {
            let there =
                [(0, 0.0, 0.0), (1, 0.0, 0.0), (2, wrong, grip), (3, 0.0, 0.0), (4, 0.0, 0.0)];
            assert_eq!(causes(there), [None; 5], "{wrong} rad, {grip} m");
        }
    }

    #[test]
    fn nan_position_is_too_fast() {
        let nan = [(0, 0.0, 0.0), (1, f64::NAN, 0.0), (2, f64::NAN, 0.0)];
        assert_eq!(causes(nan)[2], Some(Cause::Overspeed { joint: Joint::of::<3>() }));
    }

    proptest! {
        #[test]
        fn promise_14_speed_within_its_limit_is_no_fault(
            motions in prop::collection::vec((-5.9e-3..5.9e-3_f64, -0.99e-3..0.99e-3_f64, 1..4_u64), 1..99)
        ) {
            let (mut cycle, mut q, mut x) = (0, 0.0, 0.0);
            let snapshots = motions.into_iter().map(|(dq, dx, cycles)| {
                (cycle, q, x) = (cycle + cycles, q + dq, x + dx);
                (cycle, q, x)
            });
            prop_assert!(causes(snapshots).iter().all(Option::is_none));
        }
    }
}
