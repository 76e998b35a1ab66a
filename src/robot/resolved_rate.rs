//! Resolved rate (Whitney 1969): joint rates of an arm for a twist of {MRF}. The null space of a redundant arm keeps its
//! joints away from their limits.
//!
//! ```text
//!  qd = J⁺ v_m + (I - J⁺ J) z        z_i = -k u_i / (1 - u_i²)²,  u_i: -1 … 1 over the range of joint i
//! ```
//!
//! `z` descends a potential that is flat in mid-range and steep at both ends (after Liégeois 1977). Rates are evaluated at
//! the middle of the period, so that an arm under a constant twist follows its screw. [`joint_limits`](crate::joint_limits)
//! limits them.

use thiserror::Error;

use crate::chain::{Chain, Joints, MIN_JOINTS};
use crate::damped_inverse::DampedInverse;
use crate::joint_limits::JointLimits;
use units::spatial::Twist;

/// Fraction of a half-range at which the slope of the potential saturates.
const WALL: f64 = 0.95;

/// Fraction of a joint's maximum rate that centring may use.
const CENTRING_SHARE: f64 = 0.25;

/// Maximum gain of centring, in 1/s.
const MAX_CENTRING: f64 = 10.0;

/// Law from twists to joint rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedRate {
    chain: Chain,
    inverse: DampedInverse,
    limits: JointLimits,
    centring: f64,
}

/// Gain of centring out of range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("gain of null-space centring must be within 0..={MAX_CENTRING} 1/s, got {0}")]
pub struct InvalidCentring(pub f64);

impl ResolvedRate {
    /// Creates the law. `centring` is the gain of null-space centring in 1/s, without effect on an arm of six joints.
    ///
    /// # Errors
    /// Returns an error for a gain not within 0 and 10 1/s.
    pub fn new(
        chain: Chain,
        inverse: DampedInverse,
        limits: JointLimits,
        centring: f64,
    ) -> Result<Self, InvalidCentring> {
        if (0.0..=MAX_CENTRING).contains(&centring) {
            Ok(Self { chain, inverse, limits, centring })
        } else {
            Err(InvalidCentring(centring))
        }
    }

    /// Returns the kinematic chain.
    pub const fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Returns the inverse of the Jacobian.
    pub const fn inverse(&self) -> &DampedInverse {
        &self.inverse
    }

    /// Returns the limits of positions, rates and accelerations.
    pub const fn limits(&self) -> &JointLimits {
        &self.limits
    }

    /// Computes the joint rates for the next `dt` s for the twist `v_m`, at positions `q` and last rates `before`.
    pub fn rates(&self, dt: f64, q: &Joints, before: &Joints, v_m: &Twist) -> Joints {
        let first = self.unlimited(q, v_m);
        let middle = self.unlimited(&(q + first * (dt / 2.0)), v_m);
        self.limits.allowed(dt, q, before, &middle)
    }

    /// Returns the smallest singular value of the Jacobian at `q`, with lengths over the characteristic length.
    pub fn sigma_min(&self, q: &Joints) -> f64 {
        self.inverse.invert(&self.chain.forward_and_jacobian(q).1).sigma_min()
    }

    fn unlimited(&self, q: &Joints, v_m: &Twist) -> Joints {
        let (_, j_m) = self.chain.forward_and_jacobian(q);
        let inverse = self.inverse.invert(&j_m);
        let task = inverse.rates(v_m);
        if self.chain.joint_count() == MIN_JOINTS || self.centring <= 0.0 {
            return task;
        }
        task + inverse.within_null_space(&self.centring_rates(q))
    }

    /// Computes the rates `z`, away from the ends of the ranges.
    fn centring_rates(&self, q: &Joints) -> Joints {
        let mut rates = Joints::zeros();
        let joints = self.limits.joints().iter().zip(q).take(self.chain.joint_count());
        for (rate, (limit, q)) in rates.iter_mut().zip(joints) {
            let [low, high] = limit.range;
            let u = ((2.0 * q - low - high) / (high - low)).clamp(-WALL, WALL);
            let room = 1.0 - u * u;
            let slope = u / (room * room);
            let most = CENTRING_SHARE * limit.max_rate;
            *rate = (-self.centring * slope).clamp(-most, most);
        }
        rates
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use proptest::prelude::*;

    use super::*;
    use crate::joint_limits::JointLimit;
    use crate::testing::{self, eight_r, puma};

    const DT: f64 = 1e-3;

    fn law(chain: Chain) -> ResolvedRate {
        limited(chain, JointLimits::new(testing::limits(chain.joint_count())))
    }

    fn limited(chain: Chain, limits: JointLimits) -> ResolvedRate {
        ResolvedRate::new(chain, DampedInverse::default(), limits, 0.5).unwrap()
    }

    /// Follows a twist for `cycles` periods; returns the final joints and the smallest singular value met.
    fn followed(law: &ResolvedRate, q: Joints, v_m: &Twist, cycles: u32) -> (Joints, f64) {
        let (mut q, mut qd, mut least) = (q, Joints::zeros(), f64::INFINITY);
        for _ in 0..cycles {
            qd = law.rates(DT, &q, &qd, v_m);
            q += qd * DT;
            least = least.min(law.sigma_min(&q));
        }
        (q, least)
    }

    fn slow_twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-1.0..1.0_f64).prop_map(|[x, y, z, a, b, c]| {
            Twist::from_components([0.1 * x, 0.1 * y, 0.1 * z, 0.3 * a, 0.3 * b, 0.3 * c])
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn constant_twist_is_a_screw_motion(v_m in slow_twist()) {
            for chain in [puma(), eight_r()] {
                // Wide enough that no joint reaches its end in a second, at the rates of σ_min > 0.05.
                let fast = JointLimit { max_rate: 50.0, max_acceleration: 1e5, range: [-20.0, 20.0] };
                let fast = JointLimits::new((0..chain.joint_count()).map(|_| fast));
                let (law, q) = (limited(chain, fast), testing::posture(chain.joint_count()));
                let (end, sigma_min) = followed(&law, q, &v_m, 1_000);
                prop_assume!(sigma_min > 0.05);
                let expected = chain.forward(&q) * v_m.over(1.0);
                let off = expected.inverse() * chain.forward(&end);
                prop_assert!(off.translation.vector.norm() < 5e-5, "{off}");
                prop_assert!(off.rotation.angle() < 5e-5, "{off}");
            }
        }

        #[test]
        fn speed_is_bounded_through_singularities(v_m in slow_twist(), bend in -0.02..0.02_f64) {
            let law = law(puma());
            let mut q = testing::posture(6);
            q[4] = bend; // the wrist is stretched
            let (mut qd, mut x) = (Joints::zeros(), law.chain().forward(&q));
            for _ in 0..500 {
                qd = law.rates(DT, &q, &qd, &(v_m * 3.0));
                q += qd * DT;
                let next = law.chain().forward(&q);
                let v = Twist::reaching(&(x.inverse() * next), DT);
                prop_assert!(v.linear.norm() < 1.0 && v.angular.norm() < 4.0, "{v:?}");
                x = next;
            }
        }
    }

    #[test]
    fn centring_moves_a_redundant_arm_under_a_still_tool() {
        let law = law(eight_r());
        let mut q = testing::posture(8);
        q[2] += 1.2;
        let x_b_m = law.chain().forward(&q);
        let (end, _) = followed(&law, q, &Twist::ZERO, 4_000);
        assert!((end - q).norm() > 0.1, "{end}");
        let off: Isometry3<f64> = x_b_m.inverse() * law.chain().forward(&end);
        assert!(off.translation.vector.norm() < 1e-4 && off.rotation.angle() < 1e-4, "{off}");
        let potential = |q: &Joints| law.centring_rates(q).norm();
        assert!(potential(&end) < potential(&q));
    }

    #[test]
    fn invalid_gain_is_refused() {
        for wrong in [-1.0, 11.0, f64::NAN] {
            let made =
                ResolvedRate::new(puma(), DampedInverse::default(), JointLimits::new([]), wrong);
            assert!(made.is_err());
        }
    }
}
