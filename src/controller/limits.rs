//! From three torques to one that every joint can exert (3.4, both equations numbered 10).
//!
//! Not a limit of their growth from cycle to cycle: that gate stands before the bus. The assist is
//! scaled as a whole to its fraction of capacity, then task and assist as a whole to what gravity
//! leaves (decisions 13, 20, 21 and 22): directions are kept, the arm does not sag, and the task
//! dominates. Nothing is ever scaled up.

use nalgebra::SVector;
use thiserror::Error;

/// The share of each joint's capacity that the assist may take, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssistFraction(f64);

/// No such share.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the assist cannot take {0} of capacity; 0 to 1 can be taken")]
pub struct InvalidAssistFraction(pub f64);

impl AssistFraction {
    /// A share between 0 and 1.
    ///
    /// # Errors
    /// Anything else.
    pub fn new(fraction: f64) -> Result<Self, InvalidAssistFraction> {
        if (0.0..=1.0).contains(&fraction) {
            Ok(Self(fraction))
        } else {
            Err(InvalidAssistFraction(fraction))
        }
    }
}

/// The capacities of `N` joints and how they are shared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<const N: usize> {
    max_torques: SVector<f64, N>,
    assist: AssistFraction,
}

/// The torque that is left, and what it cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limited<const N: usize> {
    /// What each joint is to exert, in N·m or N; never more than its capacity, always finite.
    pub tau: SVector<f64, N>,
    /// What is left of the assist, 0 to 1.
    pub assist_scale: f64,
    /// What is left of task and scaled assist together, 0 to 1.
    pub rest_scale: f64,
    /// The joint that set `rest_scale`, from 0; none where nothing had to give.
    pub limiting_joint: Option<usize>,
    /// Whether a torque was no number: then all are zero.
    pub is_broken: bool,
}

impl<const N: usize> Limits<N> {
    /// From the most each joint may exert, which must be positive, in N·m or N.
    pub const fn new(max_torques: SVector<f64, N>, assist: AssistFraction) -> Self {
        Self { max_torques, assist }
    }

    /// Gravity, task and assist together (Eq. 10). `share` is how much of task and assist is let
    /// through at all, 0 to 1; applied last, so that a ramp of it is a ramp of the torque.
    pub fn combine(
        &self,
        tau_gravity: &SVector<f64, N>,
        tau_task: &SVector<f64, N>,
        tau_assist: &SVector<f64, N>,
        share: f64,
    ) -> Limited<N> {
        let assist_scale = self.assist_scale(tau_assist);
        let tau_rest = tau_task + tau_assist * assist_scale;
        let carried = tau_gravity.zip_map(&self.max_torques, clamp);
        let (rest_scale, limiting_joint) = self.rest_scale(&carried, &tau_rest);
        let wanted = carried + tau_rest * (rest_scale * share);
        let is_broken = !wanted.iter().all(|torque| torque.is_finite());
        let tau =
            if is_broken { SVector::zeros() } else { wanted.zip_map(&self.max_torques, clamp) };
        Limited { tau, assist_scale, rest_scale, limiting_joint, is_broken }
    }

    /// The largest scale up to 1 at which the assist keeps to its fraction on every joint.
    fn assist_scale(&self, tau_assist: &SVector<f64, N>) -> f64 {
        let AssistFraction(fraction) = self.assist;
        let joints = tau_assist.iter().zip(self.max_torques.iter());
        joints.fold(1.0, |scale, (torque, max)| scale_to(fraction * max, torque.abs()).min(scale))
    }

    /// The largest scale up to 1 at which gravity and the rest keep within capacity on every joint,
    /// and the joint that sets it.
    fn rest_scale(
        &self,
        carried: &SVector<f64, N>,
        tau_rest: &SVector<f64, N>,
    ) -> (f64, Option<usize>) {
        let joints = carried.iter().zip(tau_rest.iter()).zip(self.max_torques.iter());
        let mut tightest = (1.0, None);
        for (joint, ((gravity, rest), max)) in joints.enumerate() {
            let room = max - gravity * rest.signum();
            let scale = scale_to(room, rest.abs());
            if scale < tightest.0 {
                tightest = (scale, Some(joint));
            }
        }
        tightest
    }
}

/// The scale, at most 1, that brings `size` down to `room`; neither is negative.
fn scale_to(room: f64, size: f64) -> f64 {
    if size > room { room / size } else { 1.0 }
}

/// A torque cut off at ±`max`. Rounding may have left it a bit beyond.
fn clamp(torque: f64, max: f64) -> f64 {
    torque.clamp(-max, max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Joints = SVector<f64, 6>;

    const MAX: [f64; 6] = [6.0, 8.0, 4.0, 1.2, 1.0, 0.8];

    fn limits(fraction: f64) -> Limits<6> {
        Limits::new(Joints::from(MAX), AssistFraction::new(fraction).unwrap())
    }

    fn torques(size: f64) -> impl Strategy<Value = Joints> {
        prop::array::uniform6(-size..size).prop_map(Joints::from)
    }

    fn any_torques() -> impl Strategy<Value = Joints> {
        prop::array::uniform6(any::<f64>()).prop_map(Joints::from)
    }

    fn is_within(tau: &Joints, share: f64) -> bool {
        tau.iter().zip(MAX).all(|(torque, max)| torque.abs() <= share * max)
    }

    proptest! {
        #[test]
        fn whatever_comes_in_the_torque_is_within_capacity(
            gravity in any_torques(), task in any_torques(), assist in any_torques(),
            share in 0.0..=1.0_f64
        ) {
            let limited = limits(0.35).combine(&gravity, &task, &assist, share);
            prop_assert!(is_within(&limited.tau, 1.0));
            prop_assert!(!limited.is_broken || limited.tau == Joints::zeros());
            let finite = |tau: &Joints| tau.iter().all(|torque| torque.is_finite());
            if !(finite(&gravity) && finite(&task) && finite(&assist)) {
                prop_assert!(limited.tau.iter().all(|torque| torque.is_finite()));
            }
        }

        #[test]
        fn saturation_keeps_the_direction(task in torques(50.0)) {
            let limited = limits(0.35).combine(&Joints::zeros(), &task, &Joints::zeros(), 1.0);
            prop_assert!((limited.tau - task * limited.rest_scale).norm() < 1e-12);
            prop_assert!((0.0..=1.0).contains(&limited.rest_scale));
            prop_assert_eq!(limited.rest_scale < 1.0, limited.limiting_joint.is_some());
            prop_assert_eq!(limited.rest_scale < 1.0, !is_within(&task, 1.0));
        }

        #[test]
        fn saturation_is_idempotent(task in torques(50.0)) {
            let once = limits(0.35).combine(&Joints::zeros(), &task, &Joints::zeros(), 1.0);
            let twice = limits(0.35).combine(&Joints::zeros(), &once.tau, &Joints::zeros(), 1.0);
            prop_assert!((twice.tau - once.tau).norm() < 1e-14);
        }

        #[test]
        fn the_assist_keeps_to_its_fraction(assist in torques(50.0), fraction in 0.0..=1.0_f64) {
            let limited = limits(fraction).combine(&Joints::zeros(), &Joints::zeros(), &assist, 1.0);
            prop_assert!(is_within(&limited.tau, fraction * (1.0 + 1e-15)));
            prop_assert!((limited.tau - assist * limited.assist_scale).norm() < 1e-12);
        }

        #[test]
        fn gravity_is_never_scaled(
            share in prop::array::uniform6(-1.0..1.0_f64), task in torques(50.0),
            assist in torques(50.0)
        ) {
            let gravity = Joints::from(MAX).component_mul(&Joints::from(share));
            let limited = limits(0.35).combine(&gravity, &task, &assist, 1.0);
            let rest = (task + assist * limited.assist_scale) * limited.rest_scale;
            prop_assert!((limited.tau - gravity - rest).norm() < 1e-12);
            prop_assert!(limits(0.35).combine(&gravity, &task, &assist, 0.0).tau == gravity);
        }

        #[test]
        fn half_a_share_is_half_the_torque(task in torques(50.0), assist in torques(50.0)) {
            let whole = limits(0.35).combine(&Joints::zeros(), &task, &assist, 1.0);
            let half = limits(0.35).combine(&Joints::zeros(), &task, &assist, 0.5);
            prop_assert!((whole.tau - half.tau * 2.0).norm() < 1e-12);
        }
    }

    #[test]
    fn one_torque_that_is_no_number_stops_all() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut task = Joints::repeat(0.1);
            task[3] = bad;
            let limited = limits(0.35).combine(&Joints::zeros(), &task, &Joints::zeros(), 1.0);
            assert!(limited.is_broken && limited.tau == Joints::zeros());
        }
    }

    #[test]
    fn a_fraction_is_one() {
        for wrong in [-0.1, 1.1, f64::NAN] {
            assert!(AssistFraction::new(wrong).is_err());
        }
    }
}
