//! Monitor of friction compensation that drives a joint without a hand, because real friction is less than it may be.
//!
//! The [bound](crate::friction_bound) keeps an arm at rest whose friction is at least 0.3 of the identified one. This
//! monitor sees what the bound cannot know: less friction than that, or the full share in a contact that no hand holds. A
//! joint is self-driven while it moves with its compensation, does not slow down, and its own compensation gives more
//! than all else. A hand that moves a joint faster than `MIN_SPEED` gives more than the compensation: damping K_D takes
//! it. The full share of a contact hides slower hands, down to `MIN_SPEED_IN_CONTACT`.

use crate::JointVector;
use crate::friction_bound::GripLoad;
use units::numbering::Joint;

/// Minimum speed of a joint that counts as driven, in rad/s or m/s.
const MIN_SPEED: f64 = 0.5;

/// The same in contact, where the share is full.
const MIN_SPEED_IN_CONTACT: f64 = 1.0;

/// Motion after which the compensation is withdrawn, in rad or m.
const MAX_TRAVEL: f64 = 0.05;

/// Share of its peak speed below which a joint slows down: it coasts.
const COASTING: f64 = 0.8;

/// Decrease of the compensation per cycle once it is withdrawn: gone within 40 cycles.
const FADE: f64 = 0.9;

/// Monitor of all joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfDrive {
    joints: [Driven; 6],
    withdrawn: Option<Joint>,
    remaining: f64,
}

/// Motion of one joint since it last stopped, turned, slowed down or was driven by something else.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Driven {
    /// In rad or m, with its sign.
    travel: f64,
    /// In rad/s or m/s.
    peak: f64,
}

impl Default for SelfDrive {
    fn default() -> Self {
        Self { joints: [Driven::default(); 6], withdrawn: None, remaining: 1.0 }
    }
}

impl SelfDrive {
    /// Returns the joint that was driven by its compensation, and has lost it.
    pub const fn joint(&self) -> Option<Joint> {
        self.withdrawn
    }

    /// Takes the compensation `tau` in N·m or N at joint rates `qd`, with a motion of `dq` since the last cycle. Returns the
    /// remaining share of the compensation, 0 to 1.
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

    /// A grip that nothing touches, and whose damping takes `watts`.
    fn load(watts: f64) -> GripLoad {
        let v_g = Twist::from_components([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let against = Wrench::from_components([-watts, 0.0, 0.0, 0.0, 0.0, 0.0]);
        GripLoad::new(&v_g, &Wrench::ZERO, &Wrench::ZERO, &against)
    }

    /// Returns the motion in rad of the elbow until its compensation is withdrawn within 2 s, at a speed that depends on
    /// the time.
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
