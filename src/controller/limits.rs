//! Limits of the joint torques to capacity and rate of change (3.4, both equations numbered 10).
//!
//! The assist is scaled to its fraction of capacity, then task and assist to the capacity that gravity leaves (decisions
//! 13, 20, 21 and 22). One scale for all joints keeps directions, prevents sagging, and lets the task dominate.
//! Scales are at most 1. [`Slew`] then limits the change of each torque per cycle; a torque that is not finite sets all
//! to zero at once. With a coupling, "joint" means actuator here.

use nalgebra::SVector;
use thiserror::Error;

use crate::interpretation::TorqueScaling;
use crate::period::Period;

/// Fraction of each joint's capacity that the assist may use, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssistFraction(f64);

/// Assist fraction outside 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the assist fraction must be within 0..=1, got {0}")]
pub struct InvalidAssistFraction(pub f64);

impl AssistFraction {
    /// Returns the fraction, 0 to 1.
    pub const fn share(self) -> f64 {
        self.0
    }

    /// Creates an assist fraction.
    ///
    /// # Errors
    /// Returns an error for a fraction outside 0 to 1, or NaN.
    pub fn new(fraction: f64) -> Result<Self, InvalidAssistFraction> {
        if (0.0..=1.0).contains(&fraction) {
            Ok(Self(fraction))
        } else {
            Err(InvalidAssistFraction(fraction))
        }
    }
}

/// Capacities of `N` joints, and their division between gravity, task and assist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<const N: usize> {
    max_torques: SVector<f64, N>,
    assist: AssistFraction,
    scaling: TorqueScaling,
}

/// Requested torques, in N·m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueRequest<const N: usize> {
    /// Gravity compensation.
    pub gravity: SVector<f64, N>,
    /// Task wrench, passivity damper, soft stops and friction compensation: not scaled with the assist.
    pub task: SVector<f64, N>,
    /// Return to centre and damping.
    pub assist: SVector<f64, N>,
}

/// Torques within capacity, and the scales applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitedTorques<const N: usize> {
    /// Torque of each joint, in N·m or N, within its capacity and finite.
    pub tau: SVector<f64, N>,
    /// Scale of the assist, 0 to 1.
    pub assist_scale: f64,
    /// Scale of task and scaled assist together, 0 to 1; it includes gravity unless gravity is exempt.
    pub rest_scale: f64,
    /// Joint that determines `rest_scale`, from 0; `None` at a scale of 1.
    pub limiting_joint: Option<usize>,
    /// Set if a requested torque was not finite, so that all are zero.
    pub is_broken: bool,
}

impl<const N: usize> Limits<N> {
    /// Creates limits for these capacities, in N·m or N, which must be positive.
    pub const fn new(
        max_torques: SVector<f64, N>,
        assist: AssistFraction,
        scaling: TorqueScaling,
    ) -> Self {
        Self { max_torques, assist, scaling }
    }

    /// Combines gravity, task and assist (Eq. 10). `share`, 0 to 1, multiplies task and assist after the scaling, so that a
    /// ramp of it is a ramp of the torque.
    pub fn combine(&self, request: &TorqueRequest<N>, share: f64) -> LimitedTorques<N> {
        let TorqueRequest { gravity, task, assist } = request;
        let none = SVector::zeros();
        let (assist_scale, carried, rest, rest_scale, limiting_joint);
        match self.scaling {
            TorqueScaling::GravityExempt => {
                assist_scale = self.assist_scale(assist);
                carried = gravity.zip_map(&self.max_torques, clamp);
                rest = task + assist * assist_scale;
                (rest_scale, limiting_joint) = self.rest_scale(&carried, &rest);
            }
            TorqueScaling::Total => {
                assist_scale = self.assist_scale(assist);
                rest = task + assist * assist_scale;
                (rest_scale, limiting_joint) = self.rest_scale(&none, &(gravity + rest));
                carried = gravity * rest_scale;
            }
            TorqueScaling::AssistWithGravity => {
                assist_scale = self.assist_scale(&(gravity + assist));
                rest = task + assist * assist_scale;
                let total = rest + gravity * assist_scale;
                (rest_scale, limiting_joint) = self.rest_scale(&none, &total);
                carried = gravity * (assist_scale * rest_scale);
            }
        }
        let wanted = carried + rest * (rest_scale * share);
        // Clamping would hide infinite gravity torques.
        let is_broken = !gravity.iter().chain(wanted.iter()).all(|torque| torque.is_finite());
        let tau =
            if is_broken { SVector::zeros() } else { wanted.zip_map(&self.max_torques, clamp) };
        LimitedTorques { tau, assist_scale, rest_scale, limiting_joint, is_broken }
    }

    /// Returns the maximum scale, up to 1, at which the assist is within its fraction on every joint.
    fn assist_scale(&self, tau_assist: &SVector<f64, N>) -> f64 {
        let AssistFraction(fraction) = self.assist;
        let joints = tau_assist.iter().zip(self.max_torques.iter());
        joints.fold(1.0, |scale, (torque, max)| scale_to(fraction * max, torque.abs()).min(scale))
    }

    /// Returns the maximum scale of `tau_rest`, up to 1, and the joint that determines it. With it, the sum with `carried` is
    /// within capacity on every joint.
    fn rest_scale(
        &self,
        carried: &SVector<f64, N>,
        tau_rest: &SVector<f64, N>,
    ) -> (f64, Option<usize>) {
        let joints = carried.iter().zip(tau_rest.iter()).zip(self.max_torques.iter());
        let mut tightest = (1.0, None);
        for (joint, ((carried, rest), max)) in joints.enumerate() {
            let room = max - carried * rest.signum();
            let scale = scale_to(room, rest.abs());
            if scale < tightest.0 {
                tightest = (scale, Some(joint));
            }
        }
        tightest
    }
}

/// Maximum fall time from capacity to zero, in s, for any rise time: a released hand must be free at once.
const MAX_FALL_TIME: f64 = 0.02;

/// Limits on the change of each torque per cycle, in N·m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slew<const N: usize> {
    rise: SVector<f64, N>,
    fall: SVector<f64, N>,
    before: SVector<f64, N>,
}

/// Rise time out of range, in s.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the torque rise time must be within 0.001..=10 s, got {0}")]
pub struct InvalidRise(pub f64);

impl<const N: usize> Slew<N> {
    /// Creates limits with a rise time of `rise` s from zero to capacity, and a fall time of at most 20 ms. Torques start at
    /// zero.
    ///
    /// # Errors
    /// Returns an error for a rise time not within 0.001 and 10 s.
    pub fn new(
        max_torques: &SVector<f64, N>,
        rise: f64,
        period: Period,
    ) -> Result<Self, InvalidRise> {
        if (1e-3..=10.0).contains(&rise) {
            let in_a_cycle = |span: f64| max_torques * (period.seconds() / span).min(1.0);
            let fall = in_a_cycle(rise.min(MAX_FALL_TIME));
            Ok(Self { rise: in_a_cycle(rise), fall, before: SVector::zeros() })
        } else {
            Err(InvalidRise(rise))
        }
    }

    /// Maximum growth of a torque in one cycle, in N·m or N.
    pub const fn rise(&self) -> &SVector<f64, N> {
        &self.rise
    }

    /// Resets the last torques to zero, from which the next ones rise.
    pub fn reset(&mut self) {
        self.before = SVector::zeros();
    }

    /// Sets all torques to zero without a ramp, after an invalid torque.
    pub fn drop_to_zero(&mut self) -> (SVector<f64, N>, Option<usize>) {
        self.reset();
        (self.before, None)
    }

    /// Changes each torque towards `tau`, which must be finite, by at most its limit per cycle. Returns the torques, and the
    /// first limited joint, from 0.
    pub fn limit(&mut self, tau: &SVector<f64, N>) -> (SVector<f64, N>, Option<usize>) {
        let rates = self.rise.iter().zip(self.fall.iter());
        let mut held = None;
        for (joint, ((before, tau), (rise, fall))) in
            self.before.iter_mut().zip(tau.iter()).zip(rates).enumerate()
        {
            let by = tau - *before;
            let most = reach(*before, *tau, *rise, *fall);
            let is_held = by.abs() > most;
            held = held.or(is_held.then_some(joint));
            *before = if is_held { *before + clamp(by, most) } else { *tau };
        }
        (self.before, held)
    }
}

/// Returns the maximum change of a torque in a cycle: `rise` away from zero, `fall` towards it. `fall` is at least `rise`;
/// beyond zero at most `rise` applies.
fn reach(before: f64, tau: f64, rise: f64, fall: f64) -> f64 {
    let falls = tau.abs() < before.abs() || tau * before < 0.0;
    if falls { before.abs().clamp(rise, fall) } else { rise }
}

/// Returns the scale, at most 1, that reduces `size` to `room`. Neither is negative.
fn scale_to(room: f64, size: f64) -> f64 {
    if size > room { room / size } else { 1.0 }
}

/// Clamps a torque to ±`max`; rounding may exceed it slightly.
fn clamp(torque: f64, max: f64) -> f64 {
    torque.clamp(-max, max)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    type Joints = SVector<f64, 6>;

    const MAX: [f64; 6] = [6.0, 8.0, 4.0, 1.2, 1.0, 0.8];

    fn limits(fraction: f64) -> Limits<6> {
        scaled(TorqueScaling::GravityExempt, fraction)
    }

    fn scaled(scaling: TorqueScaling, fraction: f64) -> Limits<6> {
        Limits::new(Joints::from(MAX), AssistFraction::new(fraction).unwrap(), scaling)
    }

    fn combine(
        limits: Limits<6>,
        gravity: &Joints,
        task: &Joints,
        assist: &Joints,
    ) -> LimitedTorques<6> {
        limits.combine(&TorqueRequest { gravity: *gravity, task: *task, assist: *assist }, 1.0)
    }

    fn scaling() -> impl Strategy<Value = TorqueScaling> {
        use TorqueScaling::{AssistWithGravity, GravityExempt, Total};
        prop_oneof![Just(GravityExempt), Just(Total), Just(AssistWithGravity)]
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
        fn property_09_torque_is_within_capacity_for_any_input(
            gravity in any_torques(), task in any_torques(), assist in any_torques(),
            share in 0.0..=1.0_f64, scaling in scaling()
        ) {
            let limited = scaled(scaling, 0.35).combine(&TorqueRequest { gravity, task, assist }, share);
            prop_assert!(is_within(&limited.tau, 1.0));
            prop_assert!(!limited.is_broken || limited.tau == Joints::zeros());
            let finite = |tau: &Joints| tau.iter().all(|torque| torque.is_finite());
            if !(finite(&gravity) && finite(&task) && finite(&assist)) {
                prop_assert!(limited.tau.iter().all(|torque| torque.is_finite()));
            }
        }

        #[test]
        fn property_07_saturation_keeps_the_direction(task in torques(50.0)) {
            let limited = combine(limits(0.35), &Joints::zeros(), &task, &Joints::zeros());
            prop_assert!((limited.tau - task * limited.rest_scale).norm() < 1e-12);
            prop_assert!((0.0..=1.0).contains(&limited.rest_scale));
            prop_assert_eq!(limited.rest_scale < 1.0, limited.limiting_joint.is_some());
            prop_assert_eq!(limited.rest_scale < 1.0, !is_within(&task, 1.0));
        }

        #[test]
        fn saturation_is_idempotent(task in torques(50.0)) {
            let once = combine(limits(0.35), &Joints::zeros(), &task, &Joints::zeros());
            let twice = combine(limits(0.35), &Joints::zeros(), &once.tau, &Joints::zeros());
            prop_assert!((twice.tau - once.tau).norm() < 1e-14);
        }

        #[test]
        fn property_08_the_assist_keeps_to_its_fraction(assist in torques(50.0), fraction in 0.0..=1.0_f64) {
            let limited = combine(limits(fraction), &Joints::zeros(), &Joints::zeros(), &assist);
            prop_assert!(is_within(&limited.tau, fraction * (1.0 + 1e-15)));
            prop_assert!((limited.tau - assist * limited.assist_scale).norm() < 1e-12);
        }

        #[test]
        fn gravity_is_never_scaled(
            share in prop::array::uniform6(-1.0..1.0_f64), task in torques(50.0),
            assist in torques(50.0)
        ) {
            let gravity = Joints::from(MAX).component_mul(&Joints::from(share));
            let limited = combine(limits(0.35), &gravity, &task, &assist);
            let rest = (task + assist * limited.assist_scale) * limited.rest_scale;
            prop_assert!((limited.tau - gravity - rest).norm() < 1e-12);
            let alone = limits(0.35).combine(&TorqueRequest { gravity, task, assist }, 0.0);
            prop_assert!(alone.tau == gravity);
        }

        #[test]
        fn total_scaling_scales_gravity_with_all_the_rest(
            gravity in torques(12.0), task in torques(12.0), assist in torques(12.0)
        ) {
            let limited = combine(scaled(TorqueScaling::Total, 0.35), &gravity, &task, &assist);
            let share = |torques: &Joints, fraction: f64| {
                let ratios = torques.iter().zip(MAX).map(|(torque, max)| fraction * max / torque.abs());
                ratios.fold(1.0, f64::min)
            };
            // The assist is within its fraction, gravity excluded.
            let assist_scale = share(&assist, 0.35);
            let total = gravity + task + assist * assist_scale;
            let rest_scale = share(&total, 1.0);
            prop_assert!((limited.assist_scale - assist_scale).abs() < 1e-12);
            prop_assert!((limited.rest_scale - rest_scale).abs() < 1e-12, "{limited:?}");
            prop_assert!((limited.tau - total * rest_scale).norm() < 1e-9, "{limited:?}");
            prop_assert_eq!(limited.limiting_joint.is_some(), rest_scale < 1.0);
        }

        #[test]
        fn half_a_share_is_half_the_torque(task in torques(50.0), assist in torques(50.0)) {
            let whole = combine(limits(0.35), &Joints::zeros(), &task, &assist);
            let request = TorqueRequest { gravity: Joints::zeros(), task, assist };
            let half = limits(0.35).combine(&request, 0.5);
            prop_assert!((whole.tau - half.tau * 2.0).norm() < 1e-12);
        }
    }

    #[test]
    fn torque_that_is_not_finite_sets_all_to_zero() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let good = Joints::repeat(0.1);
            let mut torque = good;
            torque[3] = bad;
            for [gravity, task, assist] in
                [[&torque, &good, &good], [&good, &torque, &good], [&good, &good, &torque]]
            {
                let limited = combine(limits(0.35), gravity, task, assist);
                assert!(limited.is_broken && limited.tau == Joints::zeros(), "{limited:?}");
            }
        }
    }

    #[test]
    fn read_literally_the_arm_sags_when_the_assist_is_scaled() {
        let (gravity, assist) = (Joints::repeat(0.2), Joints::repeat(2.0));
        let none = Joints::zeros();
        let exempt = combine(limits(0.35), &gravity, &none, &assist);
        let literal =
            combine(scaled(TorqueScaling::AssistWithGravity, 0.35), &gravity, &none, &assist);
        assert!((exempt.tau - assist * exempt.assist_scale - gravity).norm() < 1e-12);
        assert!((literal.tau - (assist + gravity) * literal.assist_scale).norm() < 1e-12);
        assert!(literal.assist_scale < 0.2);
    }

    #[test]
    fn total_scaling_names_the_tightest_joint_and_keeps_weight() {
        let on = |torques: [f64; 3]| {
            let [first, second, third] = torques;
            Joints::from([first, second, third, 0.0, 0.0, 0.0])
        };
        // 15 of 6 N·m, 8 of 8 N·m and 8 of 4 N·m.
        let request = TorqueRequest {
            gravity: on([3.0, 1.0, 2.0]),
            task: on([12.0, 7.0, 6.0]),
            assist: Joints::zeros(),
        };
        let total = scaled(TorqueScaling::Total, 0.35);
        let limited = total.combine(&request, 1.0);
        assert!((limited.rest_scale - 0.4).abs() < 1e-12, "{limited:?}");
        assert_eq!((limited.limiting_joint, limited.assist_scale), (Some(0), 1.0));
        assert!((limited.tau - on([6.0, 3.2, 3.2])).norm() < 1e-12, "{limited:?}");
        // The share applies to task and assist; the scaled weight remains.
        let alone = total.combine(&request, 0.0);
        assert!((alone.tau - on([1.2, 0.4, 0.8])).norm() < 1e-12, "{alone:?}");
        let upwards = TorqueRequest { gravity: -request.gravity, ..request };
        assert!((total.combine(&upwards, 1.0).rest_scale - 6.0 / 9.0).abs() < 1e-12);
    }

    #[test]
    fn step_becomes_a_ramp_that_reaches_its_target() {
        let period = Period::new(1e-3).unwrap();
        let mut slew = Slew::new(&Joints::from(MAX), 0.02, period).unwrap();
        let request = Joints::from(MAX) * 0.5;
        let mut before = Joints::zeros();
        for cycle in 1..=12 {
            let (tau, held) = slew.limit(&request);
            assert!((tau - before).iter().zip(MAX).all(|(by, max)| *by <= max * 0.0501));
            assert!(cycle == 10 || held.is_some() == (cycle < 10), "cycle {cycle}");
            before = tau;
        }
        assert_eq!(before, request);
        for wrong in [0.0, -1.0, 20.0, f64::NAN] {
            assert!(Slew::new(&Joints::from(MAX), wrong, period).is_err());
        }
    }

    #[test]
    fn hazard_38_slow_torque_ends_within_twenty_milliseconds() {
        let mut slew = Slew::new(&Joints::from(MAX), 2.0, Period::new(1e-3).unwrap()).unwrap();
        (0..2_000).for_each(|_| {
            slew.limit(&Joints::from(MAX));
        });
        let falling: Vec<Joints> = (0..20).map(|_| slew.limit(&Joints::zeros()).0).collect();
        assert!(falling[0].iter().zip(MAX).all(|(tau, max)| (tau - 0.95 * max).abs() < 1e-9));
        assert!(falling[19].amax() < 1e-9, "{}", falling[19]);
        (0..2_000).for_each(|_| {
            slew.limit(&Joints::from(MAX));
        });
        let other_side: Vec<Joints> = (0..21).map(|_| slew.limit(&-Joints::from(MAX)).0).collect();
        assert!(
            other_side[20].iter().zip(MAX).all(|(tau, max)| (tau + max / 2_000.0).abs() < 1e-9)
        );
    }

    #[test]
    fn fraction_outside_0_to_1_is_refused() {
        for wrong in [-0.1, 1.1, f64::NAN] {
            assert!(AssistFraction::new(wrong).is_err());
        }
    }

    #[test]
    fn torques_of_both_signs_end_within_twenty_milliseconds() {
        let max = SVector::from([4.0]);
        for sign in [1.0, -1.0] {
            let mut slew = Slew::<1>::new(&max, 0.2, Period::new(1e-3).unwrap()).unwrap();
            (0..300).for_each(|_| _ = slew.limit(&(max * sign)));
            let cycles = (1..).find(|_| slew.limit(&SVector::zeros()).0[0] == 0.0);
            assert!(cycles.is_some_and(|cycles| cycles <= 21), "{cycles:?} cycles of {sign}");
        }
    }
}
