//! Friction compensation: a feed-forward of the joints' dry and viscous friction, with presliding memory.
//!
//! Not in the paper. Dry friction at rest depends on the last motion, and no velocity shows it. It resists a hand that has
//! moved into a contact and holds still. Dahl's model (Dahl 1968) describes it by a state `z` of each joint, -1 to 1, that
//! reverses over a presliding distance `x_s`:
//!
//! ```text
//!  dz/dq = (1 - z sgn q̇) / x_s          exactly, over a motion Δq > 0:  z := 1 - (1 - z) exp(-Δq / x_s)
//!  τ     = s (f_c z + f_v q̇)            s: share that is compensated
//! ```
//!
//! Dahl's friction is the torque -f_c z on the joint. `|z| ≤ 1`, so the compensation of dry friction is at most `s f_c`.
//! Real friction of at least `s f_c` dissipates all energy of the feed-forward, at any delay. Less friction would let the
//! feed-forward drive the joint, so `s` is at most [`MAX_SHARE`]: it allows for the error of identification. In free
//! motion `s` is [bounded](crate::friction_bound) further. A joint that drives itself nevertheless
//! [loses its compensation](crate::self_drive).

use thiserror::Error;

use crate::JointVector;
use crate::friction_bound::GripLoad;
use crate::self_drive::SelfDrive;
use units::math;
use units::numbering::Joint;

/// Maximum compensated share of friction: load, temperature and wear may reduce real friction to 0.7 of the identified one.
pub const MAX_SHARE: f64 = 0.7;

/// Parameters of the compensation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionSettings {
    /// Compensated share of the friction, 0 to [`MAX_SHARE`].
    pub share: f64,
    /// Identified dry friction of each joint, in N·m or N.
    pub coulomb: JointVector,
    /// Identified viscous friction of each joint, in N·m·s/rad or N·s/m.
    pub viscous: JointVector,
    /// Presliding distance of each joint, in rad or m.
    pub presliding: JointVector,
}

/// Parameter of [`FrictionSettings`] out of range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{quantity} of the friction compensation must be within {low}..={high}, got {value}")]
pub struct InvalidFriction {
    /// Name of the parameter.
    pub quantity: &'static str,
    /// Smallest valid value.
    pub low: f64,
    /// Largest valid value.
    pub high: f64,
    /// Rejected value, in the unit of the parameter.
    pub value: f64,
}

/// Friction compensation with the state of every joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionCompensation {
    settings: FrictionSettings,
    /// State of Dahl's model, -1 to 1.
    z: JointVector,
    q_before: Option<JointVector>,
    self_drive: SelfDrive,
}

impl FrictionCompensation {
    /// Creates a compensation whose state is zero on every joint.
    ///
    /// # Errors
    /// Returns the first parameter out of range: share, friction or presliding distance.
    pub fn new(settings: FrictionSettings) -> Result<Self, InvalidFriction> {
        let FrictionSettings { share, coulomb, viscous, presliding } = &settings;
        let within = |quantity, [low, high]: [f64; 2], value: f64| {
            let error = InvalidFriction { quantity, low, high, value };
            if (low..=high).contains(&value) { Ok(()) } else { Err(error) }
        };
        within("the share", [0.0, MAX_SHARE], *share)?;
        coulomb.iter().try_for_each(|f| within("dry friction", [0.0, 1e4], *f))?;
        viscous.iter().try_for_each(|f| within("viscous friction", [0.0, 1e4], *f))?;
        presliding.iter().try_for_each(|x| within("the presliding distance", [1e-5, 1.0], *x))?;
        Ok(Self {
            settings,
            z: JointVector::zeros(),
            q_before: None,
            self_drive: SelfDrive::default(),
        })
    }

    /// Returns the parameters.
    pub const fn settings(&self) -> &FrictionSettings {
        &self.settings
    }

    /// Negative stiffness of the feed-forward at each joint, without its friction: `s f_c / x_s`, in N·m/rad or N/m.
    pub fn negative_stiffness(&self) -> JointVector {
        let FrictionSettings { share, coulomb, presliding, .. } = &self.settings;
        coulomb.component_div(presliding) * *share
    }

    /// Returns the joint that the compensation drove without a hand. The compensation is withdrawn until [`Self::rearm`].
    pub const fn self_driven(&self) -> Option<Joint> {
        self.self_drive.joint()
    }

    /// Restores a withdrawn compensation.
    pub fn rearm(&mut self) {
        self.self_drive = SelfDrive::default();
    }

    /// Updates the state with joint positions `q`; returns the compensating torques, in N·m or N.
    ///
    /// Each motion updates the state, gaps included. `qd` is the rate since the last cycle, in rad/s or m/s. `load`
    /// bounds the share; `weight`, 0 to 1, scales the result.
    pub fn torques(
        &mut self,
        q: &JointVector,
        qd: &JointVector,
        load: &GripLoad,
        weight: f64,
    ) -> JointVector {
        let FrictionSettings { share, coulomb, viscous, presliding } = &self.settings;
        let dq = q - self.q_before.replace(*q).unwrap_or(*q);
        for (z, (dq, x_s)) in self.z.iter_mut().zip(dq.iter().zip(presliding.iter())) {
            *z = turned(*z, *dq, *x_s);
        }
        let all = coulomb.component_mul(&self.z) + viscous.component_mul(qd);
        let tau = all * (load.share(*share, all.dot(qd)) * weight);
        tau * self.self_drive.update(&tau, &dq, qd, load)
    }
}

/// Returns Dahl's state after a motion `dq` of a joint with presliding distance `x_s`.
fn turned(z: f64, dq: f64, x_s: f64) -> f64 {
    // A position that is not finite resets the state.
    let end = if dq.is_finite() { dq.signum() } else { return 0.0 };
    end - (end - z) * math::exp(-dq.abs() / x_s)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use units::spatial::{Twist, Wrench};

    const F_C: f64 = 0.06;
    const X_S: f64 = 2e-3;

    fn settings() -> FrictionSettings {
        FrictionSettings {
            share: 0.7,
            coulomb: JointVector::repeat(F_C),
            viscous: JointVector::zeros(),
            presliding: JointVector::repeat(X_S),
        }
    }

    fn compensation() -> FrictionCompensation {
        FrictionCompensation::new(settings()).unwrap()
    }

    /// Returns the load of a grip that a surface presses with 2 N: the full share.
    fn contact() -> GripLoad {
        let f_g = Wrench::from_components([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        GripLoad::new(&Twist::ZERO, &f_g, &Wrench::ZERO, &Wrench::ZERO)
    }

    /// Returns the same load in a motion from which damping takes 0.02 W.
    fn damped() -> GripLoad {
        let along = |y| [0.0, y, 0.0, 0.0, 0.0, 0.0];
        let f_g = Wrench::from_components([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let against = Wrench::from_components(along(-1.0));
        GripLoad::new(&Twist::from_components(along(0.02)), &f_g, &Wrench::ZERO, &against)
    }

    /// Returns the torque of the first joint along a path.
    fn along(path: impl IntoIterator<Item = f64>) -> f64 {
        let mut compensation = compensation();
        let step = |q| {
            compensation.torques(&JointVector::repeat(q), &JointVector::zeros(), &contact(), 1.0)[0]
        };
        path.into_iter().map(step).last().unwrap()
    }

    #[test]
    fn motion_is_helped_and_rest_keeps_what_motion_left() {
        let full = 0.7 * F_C;
        assert!((along((0..100).map(|k| 1e-3 * f64::from(k))) - full).abs() < 1e-9);
        let moved_and_held = (0..100).map(|k| 1e-3 * f64::from(k)).chain([0.099; 500]);
        assert!((along(moved_and_held) - full).abs() < 1e-9);
        assert!(along([0.3; 500]).abs() <= 0.0, "nothing is known of a joint that did not move");
    }

    #[test]
    fn reversal_turns_the_torque_over_the_presliding_distance() {
        let there = || (0..100).map(|k| 1e-3 * f64::from(k));
        // From z = 1, halfway: 2 exp(-x/x_s) = 1.
        let back = 0.099 - X_S * std::f64::consts::LN_2;
        assert!(along(there().chain([back])).abs() < 1e-9);
        let back = (0..10_u32).map(|k| 0.099 - 2e-3 * f64::from(k));
        assert!((along(there().chain(back)) + 0.7 * F_C).abs() < 1e-3);
    }

    #[test]
    fn steps_of_any_size_lead_to_the_same_state() {
        let fine = along((0..=1_000).map(|k| 3e-6 * f64::from(k)));
        let coarse = along([0.0, 1e-3, 3e-3]);
        assert!((fine - coarse).abs() < 1e-12);
    }

    #[test]
    fn withdrawn_compensation_acts_again_once_it_is_rearmed() {
        let mut compensation = compensation();
        let mut at = |cycle: u32, rearm: bool| {
            if rearm {
                compensation.rearm();
            }
            let q = JointVector::repeat(1.2e-3 * f64::from(cycle));
            let tau = compensation.torques(&q, &JointVector::repeat(1.2), &damped(), 1.0)[0];
            (tau, compensation.self_driven())
        };
        let driven = (0..200).map(|cycle| at(cycle, false)).last().unwrap();
        assert!(driven.0 < 1e-6 && driven.1 == Some(Joint::of::<1>()), "{driven:?}");
        let (tau, self_driven) = at(200, true);
        assert!((tau - 0.7 * F_C).abs() < 1e-9 && self_driven.is_none(), "{tau}");
    }

    #[test]
    fn invalid_parameter_is_named() {
        let share = |share| FrictionCompensation::new(FrictionSettings { share, ..settings() });
        assert_eq!(
            share(0.8).unwrap_err().to_string(),
            "the share of the friction compensation must be within 0..=0.7, got 0.8"
        );
        assert!(share(-0.1).is_err() && share(f64::NAN).is_err());
        for wrong in [-0.1, f64::NAN, f64::INFINITY] {
            let wrong = JointVector::repeat(wrong);
            assert!(
                FrictionCompensation::new(FrictionSettings { coulomb: wrong, ..settings() })
                    .is_err()
            );
            assert!(
                FrictionCompensation::new(FrictionSettings { viscous: wrong, ..settings() })
                    .is_err()
            );
            assert!(
                FrictionCompensation::new(FrictionSettings { presliding: wrong, ..settings() })
                    .is_err()
            );
        }
    }

    proptest! {
        #[test]
        fn friction_takes_all_that_is_given(
            steps in prop::collection::vec(-0.01..0.01_f64, 3..200), way in prop::sample::select(vec![-1.0, 1.0])
        ) {
            // Torque of two cycles ago, against dry friction 30 % below the identified one. A steady motion over ten
            // presliding distances ends it, with that friction fully developed.
            let mut compensation = compensation();
            let (mut q, mut delayed, mut given) = (0.0, [0.0; 2], 0.0);
            let steady = [way * X_S; 12];
            for dq in steps.into_iter().chain(steady) {
                q += dq;
                let [last, acted] = delayed;
                given = acted * dq;
                prop_assert!(given <= 0.7 * F_C * dq.abs() + 1e-15);
                let tau = compensation.torques(&JointVector::repeat(q), &JointVector::zeros(), &contact(), 1.0)[0];
                delayed = [tau, last];
            }
            prop_assert!(given >= 0.999 * 0.7 * F_C * X_S, "{given} J");
        }

        #[test]
        fn torque_is_bounded_and_finite(q in prop::collection::vec(any::<f64>(), 1..50)) {
            let mut compensation = compensation();
            for q in q {
                let tau = compensation.torques(&JointVector::repeat(q), &JointVector::zeros(), &contact(), 1.0);
                prop_assert!(tau.iter().all(|tau| tau.abs() <= 0.7 * F_C + 1e-12), "{tau}");
            }
        }
    }
}
