//! Kinematic arm that follows twists of its tool exactly, within the limits of its joints (mode 1 of the paper,
//! section 4).
//!
//! Its joints have no mass and integrate their rates. Servo lag belongs to the [`object`](crate::object) that it holds.

use nalgebra::Isometry3;

use crate::chain::Joints;
use crate::resolved_rate::ResolvedRate;
use units::spatial::Twist;

/// Kinematic arm with joint positions and rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowingArm {
    law: ResolvedRate,
    q: Joints,
    qd: Joints,
}

impl FollowingArm {
    /// Creates an arm at rest at `q`, in rad, which should be within its limits.
    pub fn new(law: ResolvedRate, q: Joints) -> Self {
        Self { law, q, qd: Joints::zeros() }
    }

    /// Returns the joint positions, in rad.
    pub const fn q(&self) -> &Joints {
        &self.q
    }

    /// Returns the joint rates, in rad/s.
    pub const fn qd(&self) -> &Joints {
        &self.qd
    }

    /// Returns the pose of {MRF} in {b}.
    pub fn pose(&self) -> Isometry3<f64> {
        self.law.chain().forward(&self.q)
    }

    /// Returns the smallest singular value at the present posture, with lengths over the characteristic length.
    pub fn sigma_min(&self) -> f64 {
        self.law.sigma_min(&self.q)
    }

    /// Moves for `dt` s with a twist of {MRF}; returns the resulting pose. Stops if twist or time are not finite.
    pub fn moved(&mut self, dt: f64, v_m: &Twist) -> Isometry3<f64> {
        if v_m.is_finite() && dt.is_finite() && dt > 0.0 {
            self.qd = self.law.rates(dt, &self.q, &self.qd, v_m);
            self.q += self.qd * dt;
        } else {
            self.qd = Joints::zeros();
        }
        self.pose()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{self, puma};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(50))]

        #[test]
        fn joint_limits_hold_in_random_commands(
            commands in prop::collection::vec(prop::array::uniform6(-3.0..3.0_f64), 200)
        ) {
            let mut arm = FollowingArm::new(testing::law(puma(), 30.0), testing::posture(6));
            for v in commands {
                let v_m = Twist::from_components(v);
                for _ in 0..20 {
                    arm.moved(1e-3, &v_m);
                    prop_assert!(arm.q().iter().all(|q| q.abs() <= 2.8 + 1e-12), "{}", arm.q());
                }
            }
        }
    }

    #[test]
    fn twist_that_is_no_number_stops_the_arm() {
        let mut arm = FollowingArm::new(testing::law(puma(), 30.0), testing::posture(6));
        arm.moved(1e-3, &Twist::from_components([0.1; 6]));
        let before = *arm.q();
        for (dt, v) in [(1e-3, f64::NAN), (f64::NAN, 0.1), (0.0, 0.1), (-1.0, 0.1)] {
            arm.moved(dt, &Twist::from_components([v; 6]));
            assert_eq!((arm.q(), arm.qd()), (&before, &Joints::zeros()));
        }
    }
}
