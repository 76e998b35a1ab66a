//! Monitor that withdraws friction compensation if it drives a joint without a hand.
//!
//! The [bound](crate::friction_bound) keeps an arm at rest whose friction is at least 0.3 of the identified one. This
//! monitor detects the remaining cases: less friction than that, or the full share in a contact that no hand holds. A
//! joint is self-driven while it moves with its compensation, does not slow down, and the compensation is the main source
//! of its power. Above `MIN_SPEED` a hand gives more power than the compensation, since K_D dissipates it. In contact,
//! with the full share, that holds above `MIN_SPEED_IN_CONTACT`.

use crate::JointVector;
use crate::friction_bound::GripLoad;
use units::numbering::Joint;

/// Minimum speed of a self-driven joint in free motion, in rad/s or m/s.
const MIN_SPEED: f64 = 0.5;

/// Minimum speed of a self-driven joint in contact, with the full share, in rad/s or m/s.
const MIN_SPEED_IN_CONTACT: f64 = 1.0;

/// Self-driven motion after which the compensation is withdrawn, in rad or m.
const MAX_TRAVEL: f64 = 0.05;

/// Fraction of its peak speed below which a joint coasts.
const COASTING: f64 = 0.8;

/// Factor on a withdrawn compensation per cycle: 1.5 % remain after 40 cycles.
const FADE: f64 = 0.9;

/// Self-drive monitor of all joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfDrive {
    joints: [Driven; 6],
    withdrawn: Option<Joint>,
    remaining: f64,
}

/// Self-driven motion of one joint since it last stopped, reversed, coasted or had another drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Driven {
    /// Signed travel, in rad or m.
    travel: f64,
    /// Maximum speed, in rad/s or m/s.
    peak: f64,
}

impl Default for SelfDrive {
    fn default() -> Self {
        Self { joints: [Driven::default(); 6], withdrawn: None, remaining: 1.0 }
    }
}

impl SelfDrive {
    /// Returns the self-driven joint for which the compensation was withdrawn.
    pub const fn joint(&self) -> Option<Joint> {
        self.withdrawn
    }

    /// Updates the monitor with the compensation `tau` in N·m or N, the motion `dq` of this cycle and the joint rates `qd`.
    /// Returns the remaining share of the compensation, 0 to 1.
    pub fn update(
        &mut self,
        tau: &JointVector,
        dq: &JointVector,
        qd: &JointVector,
        load: &GripLoad,
    ) -> f64 {
        let all = tau.dot(qd);
        let min_speed = MIN_SPEED + (MIN_SPEED_IN_CONTACT - MIN_SPEED) * load.contact();
        let rates = tau.iter().zip(dq.iter().zip(qd.iter()));
        for ((joint, driven), (tau, (dq, qd))) in Joint::ALL.iter().zip(&mut self.joints).zip(rates)
        {
            let is_driven = load.is_driven_by_friction(tau * qd, all) && qd.abs() > min_speed;
            driven.update(is_driven, *dq, *qd);
            if driven.travel.abs() > MAX_TRAVEL {
                self.withdrawn = self.withdrawn.or(Some(*joint));
            }
        }
        if self.withdrawn.is_some() {
            self.remaining *= FADE;
        }
        self.remaining
    }
}

impl Driven {
    fn update(&mut self, is_driven: bool, dq: f64, qd: f64) {
        let coasts = qd.abs() < COASTING * self.peak;
        *self = match (is_driven, coasts || self.travel * qd < 0.0) {
            (false, _) => Self::default(),
            (true, true) => Self { travel: 0.0, peak: qd.abs() },
            (true, false) => Self { travel: self.travel + dq, peak: self.peak.max(qd.abs()) },
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::math;
    use units::spatial::{Twist, Wrench};

    const DT: f64 = 1e-3;

    /// Returns the load of a grip without contact whose damping dissipates `watts`.
    fn load(watts: f64) -> GripLoad {
        let v_g = Twist::from_components([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let against = Wrench::from_components([-watts, 0.0, 0.0, 0.0, 0.0, 0.0]);
        GripLoad::new(&v_g, &Wrench::ZERO, &Wrench::ZERO, &against)
    }

    /// Returns the elbow's motion in rad until the compensation is withdrawn, within 2 s, for a speed over time.
    fn travel(tau: f64, speed: impl Fn(f64) -> f64, watts: f64) -> Option<f64> {
        let mut monitor = SelfDrive::default();
        let mut q = 0.0;
        (0..2_000_u32).find_map(|ms| {
            let qd = speed(f64::from(ms) * DT);
            q += qd * DT;
            let joints = |value| JointVector::from([0.0, 0.0, value, 0.0, 0.0, 0.0]);
            monitor.update(&joints(tau), &joints(qd * DT), &joints(qd), &load(watts));
            monitor.joint().map(|joint| {
                assert_eq!(joint, Joint::of::<3>());
                q
            })
        })
    }

    #[test]
    fn self_driven_joint_loses_its_compensation_at_once() {
        for speed in [0.55, 1.0, -1.0] {
            let at = travel(0.04 * f64::signum(speed), |_| speed, 0.003).unwrap();
            assert!((0.05..0.052).contains(&at.abs()), "{at} rad");
        }
        let speeds_up = travel(0.04, |t| 2.0 * t, 0.006).unwrap();
        assert!(speeds_up < 0.12, "{speeds_up} rad");
    }

    #[test]
    fn motion_of_another_source_keeps_its_compensation() {
        assert_eq!(travel(0.04, |_| 0.45, 0.001), None, "slow");
        assert_eq!(travel(-0.04, |_| 1.0, 0.004), None, "against the compensation");
        assert_eq!(travel(0.04, |t| 1.0 * math::exp(-t / 0.1), 0.003), None, "coasts");
        assert_eq!(travel(0.04, |_| 1.0, 0.05), None, "the hand overcomes the damping");
        assert_eq!(travel(0.04, |_| 1.0, 0.0), None, "nothing shows a hand");
        assert_eq!(travel(0.04, |t| math::sin(40.0 * t), 0.0005), None, "swings by 0.05 rad");
        assert_eq!(travel(f64::NAN, |_| f64::NAN, 0.001), None);
    }

    #[test]
    fn withdrawn_compensation_fades_and_stays_away() {
        let mut monitor = SelfDrive::default();
        let all = JointVector::repeat(0.6);
        let mut before = 1.0;
        for cycle in 0..1_000 {
            let remaining = monitor.update(&all, &(all * DT), &all, &load(0.2));
            assert!(before - remaining <= 0.1 + 1e-12 && remaining <= before, "{cycle}");
            before = remaining;
        }
        assert!(before < 1e-12 && monitor.joint() == Some(Joint::of::<1>()));
        let none = JointVector::zeros();
        assert!(monitor.update(&none, &none, &none, &load(0.2)) < 1e-12, "at rest, too");
    }
}
