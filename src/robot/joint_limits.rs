//! Limits of joint positions, rates and accelerations that keep the direction of motion.
//!
//! All joints slow down together, so the arm stays on its line in joint space, and a twist keeps its direction. A step is
//! allowed if the arm can then still stop on this line within the limits of acceleration and position. Stopping is always
//! possible after an allowed step, so position limits hold by construction.

use crate::chain::{Joints, MAX_JOINTS};

/// Bisections of the search for the maximum allowed step.
const HALVINGS: u32 = 12;

/// Limits of all joints; absent joints are not limited.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    joints: [JointLimit; MAX_JOINTS],
}

/// Range, maximum rate and maximum acceleration of a revolute joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimit {
    /// Minimum and maximum position, in rad.
    pub range: [f64; 2],
    /// Maximum rate, in rad/s.
    pub max_rate: f64,
    /// Maximum acceleration, in rad/s².
    pub max_acceleration: f64,
}

impl JointLimit {
    const NONE: Self = Self {
        range: [f64::NEG_INFINITY, f64::INFINITY],
        max_rate: f64::INFINITY,
        max_acceleration: f64::INFINITY,
    };

    /// Returns whether position `q` is within the range, or rate `qd` leads back into it.
    fn allows(&self, q: f64, qd: f64) -> bool {
        let [low, high] = self.range;
        (q >= low || qd >= 0.0) && (q <= high || qd <= 0.0)
    }
}

impl JointLimits {
    /// Creates limits from those of each joint, base first; more than nine are ignored.
    pub fn new(joints: impl IntoIterator<Item = JointLimit>) -> Self {
        let mut all = [JointLimit::NONE; MAX_JOINTS];
        for (place, joint) in all.iter_mut().zip(joints) {
            *place = joint;
        }
        Self { joints: all }
    }

    /// Returns the limits, base first; infinite for absent joints.
    pub const fn joints(&self) -> &[JointLimit; MAX_JOINTS] {
        &self.joints
    }

    /// Returns the allowed rates for the next `dt` s nearest to `wanted`, on the line from `before`, at positions `q`.
    /// Stops the arm if `wanted` is not finite.
    pub fn allowed(&self, dt: f64, q: &Joints, before: &Joints, wanted: &Joints) -> Joints {
        let braked = before * (1.0 - self.part(dt, before).min(1.0));
        if !wanted.iter().all(|rate| rate.is_finite()) {
            return braked;
        }
        let change = wanted * self.rate_part(wanted) - before;
        let next = before + change * self.part(dt, &change).min(1.0);
        if self.can_stop(dt, q, &next) {
            return next;
        }
        let (mut kept, mut step) = (0.0, 0.5);
        for _ in 0..HALVINGS {
            let more = kept + step;
            if self.can_stop(dt, q, &braked.lerp(&next, more)) {
                kept = more;
            }
            step *= 0.5;
        }
        braked.lerp(&next, kept)
    }

    /// Returns the maximum factor on rates, at most 1, that satisfies every rate limit.
    fn rate_part(&self, rates: &Joints) -> f64 {
        let joints = self.joints.iter().zip(rates);
        joints.fold(1.0, |part, (joint, rate)| part.min(ratio(joint.max_rate, rate.abs())))
    }

    /// Returns the fraction of a change of rates that the acceleration limits permit in `dt` s; may exceed 1.
    fn part(&self, dt: f64, change: &Joints) -> f64 {
        let joints = self.joints.iter().zip(change);
        joints.fold(f64::INFINITY, |part, (joint, change)| {
            part.min(ratio(joint.max_acceleration * dt, change.abs()))
        })
    }

    /// Returns whether the arm, after `dt` s at these rates, can stop on their line within all ranges.
    fn can_stop(&self, dt: f64, q: &Joints, rates: &Joints) -> bool {
        let stop_time = self.part(1.0, rates).recip();
        // Rates that fall in steps of dt travel less than rates that fall linearly.
        let travel = dt + stop_time / 2.0;
        let ends = self.joints.iter().zip(q.iter().zip(rates));
        ends.into_iter().all(|(joint, (q, rate))| joint.allows(q + rate * travel, *rate))
    }
}

/// Returns `most / value`; infinity for a value that is not positive.
fn ratio(most: f64, value: f64) -> f64 {
    if value > 0.0 { most / value } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::joints;

    const DT: f64 = 1e-3;

    fn limits() -> JointLimits {
        JointLimits::new((0..6).map(|joint| JointLimit {
            range: [-1.0 - 0.1 * f64::from(joint), 1.5],
            max_rate: 1.0 + 0.2 * f64::from(joint),
            max_acceleration: 5.0 + f64::from(joint),
        }))
    }

    fn rates() -> impl Strategy<Value = Joints> {
        prop_oneof![joints(0.2), joints(20.0)]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        #[test]
        fn all_limits_hold_for_any_commands(
            commands in prop::collection::vec((rates(), 1..200_u32), 10..40)
        ) {
            let (limits, mut q, mut qd) = (limits(), Joints::zeros(), Joints::zeros());
            for (wanted, cycles) in commands {
                for _ in 0..cycles {
                    let next = limits.allowed(DT, &q, &qd, &wanted);
                    q += next * DT;
                    for (joint, limit) in limits.joints.iter().enumerate().take(6) {
                        let [low, high] = limit.range;
                        prop_assert!((low - 1e-12..=high + 1e-12).contains(&q[joint]), "{joint} at {}", q[joint]);
                        prop_assert!(next[joint].abs() <= limit.max_rate + 1e-12);
                        let change = (next[joint] - qd[joint]).abs() / DT;
                        prop_assert!(change <= limit.max_acceleration + 1e-9, "{joint}: {change}");
                    }
                    qd = next;
                }
            }
        }

        #[test]
        fn limits_keep_the_direction_of_motion(wanted in rates()) {
            let (limits, mut q, mut qd) = (limits(), Joints::zeros(), Joints::zeros());
            for _ in 0..3_000 {
                qd = limits.allowed(DT, &q, &qd, &wanted);
                q += qd * DT;
            }
            let line = wanted.normalize();
            prop_assert!((q - line * q.dot(&line)).norm() < 1e-9 * (1.0 + q.norm()));
            prop_assert!(q.dot(&line) > 0.0);
        }
    }

    #[test]
    fn arm_stops_at_a_limit_and_leaves_it() {
        let (limits, mut q, mut qd) = (limits(), Joints::zeros(), Joints::zeros());
        let mut wanted = Joints::zeros();
        wanted[2] = 1.0;
        let mut play = |wanted: &Joints, cycles| {
            for _ in 0..cycles {
                qd = limits.allowed(DT, &q, &qd, wanted);
                q += qd * DT;
            }
            (q[2], qd[2])
        };
        let (at_limit, rate) = play(&wanted, 5_000);
        assert!((1.499..=1.5).contains(&at_limit) && rate < 2e-3, "{at_limit} {rate}");
        let (left, rate) = play(&-wanted, 1_000);
        assert!(left < 1.0 && (rate + 1.0).abs() < 1e-9);
    }

    #[test]
    fn joint_beyond_its_range_may_only_return() {
        let limits = limits();
        let mut q = Joints::zeros();
        q[0] = 1.6;
        let mut wanted = Joints::zeros();
        wanted[0] = 0.5;
        assert_eq!(limits.allowed(DT, &q, &Joints::zeros(), &wanted), Joints::zeros());
        assert!(limits.allowed(DT, &q, &Joints::zeros(), &-wanted)[0] < 0.0);
    }

    #[test]
    fn rates_that_are_no_numbers_stop_the_arm() {
        let (limits, mut qd) = (limits(), Joints::repeat(0.5));
        let mut wrong = Joints::zeros();
        wrong[3] = f64::NAN;
        for _ in 0..200 {
            qd = limits.allowed(DT, &Joints::zeros(), &qd, &wrong);
        }
        assert_eq!(qd, Joints::zeros());
    }
}
