//! Operator model: a [hand](crate::hand) impedance with reaction time, tremor and startle.
//!
//! The model reacts to a wrench after the reaction time, and through the lag of the muscles (Zajac 1989). With `f` the
//! wrench after both, and `K` the stiffness of the hand:
//!
//! ```text
//!  yielding     moves the set point by  yielding · f / K: the force falls to 1 / (1 + yielding) in the end
//!  stiffening   raises the stiffness to K (1 + stiffening · |f| / maximum force), the damping by its square root
//!  startle      opens the hand when f differs by more than `startle` from its average of the last 0.25 s
//! ```
//!
//! A startled operator has released the grip and its deadman switch until the script releases and holds them again.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::delay::Delay;
use crate::hand::Hand;
use crate::operator_settings::OperatorSettings;
use crate::tremor::Tremor;
use units::spatial::Wrench;

/// Time constant of the muscles, in s.
const MUSCLE_LAG: f64 = 0.05;

/// Time constant of the average that startle compares with, in s.
const STARTLE_AVERAGING: f64 = 0.25;

/// Impedance and set point of a hand on the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grasp {
    /// Impedance.
    pub hand: Hand,
    /// Desired pose of the grip.
    pub x_0_d: Isometry3<f64>,
}

/// State of one operator.
#[derive(Clone, Debug)]
pub struct OperatorModel {
    settings: OperatorSettings,
    tremor: Tremor,
    reaction_delay: Delay,
    /// Wrench on the grip after reaction time and muscle lag, at {G} in {G}.
    delayed_wrench: Wrench,
    /// Average force on the grip, in {G}, in N.
    average_force: Vector3<f64>,
    is_startled: bool,
}

impl OperatorModel {
    /// Creates an operator; `seed` determines the tremor.
    pub fn new(settings: OperatorSettings, seed: u64) -> Self {
        Self {
            settings,
            tremor: Tremor::new(settings.shake, seed),
            reaction_delay: Delay::new(settings.reaction),
            delayed_wrench: Wrench::ZERO,
            average_force: Vector3::zeros(),
            is_startled: false,
        }
    }

    /// Returns the reaction time, in s.
    pub const fn reaction(&self) -> f64 {
        self.settings.reaction
    }

    /// Returns whether a startle has opened the hand.
    pub const fn is_startled(&self) -> bool {
        self.is_startled
    }

    /// Advances by `dt` s and returns the grasp, `None` when the hand is open. `x_0_script` is the pose in the
    /// script; `f_g` is the wrench of the hand on the grip, at {G} in {G}.
    pub fn step(
        &mut self,
        dt: f64,
        x_0_script: &Isometry3<f64>,
        is_holding: bool,
        f_g: &Wrench,
    ) -> Option<Grasp> {
        self.react(dt, f_g, is_holding);
        let tremor = self.tremor.next(dt);
        let grasp = Grasp { hand: self.hand(), x_0_d: self.desired_pose(x_0_script, &tremor) };
        (is_holding && !self.is_startled).then_some(grasp)
    }

    fn react(&mut self, dt: f64, f_g: &Wrench, is_holding: bool) {
        let delayed = self.reaction_delay.step(dt, *f_g);
        self.delayed_wrench =
            self.delayed_wrench + (delayed - self.delayed_wrench) * first_order(dt, MUSCLE_LAG);
        let change = delayed.force - self.average_force;
        self.average_force += change * first_order(dt, STARTLE_AVERAGING);
        let is_startling = self.settings.startle.is_some_and(|most| change.norm() > most);
        self.is_startled = is_holding && (self.is_startled || is_startling);
    }

    /// Returns the impedance at the present effort.
    fn hand(&self) -> Hand {
        let OperatorSettings { hand, stiffening, .. } = self.settings;
        let effort = (self.delayed_wrench.force.norm() / hand.max_force).min(1.0);
        hand.stiffened(1.0 + stiffening * effort)
    }

    /// Returns the desired pose of the grip: the pose of the script with tremor and yielding.
    fn desired_pose(&self, x_0_script: &Isometry3<f64>, tremor: &Vector3<f64>) -> Isometry3<f64> {
        let OperatorSettings { hand, yielding, .. } = self.settings;
        // The wrench is in {G}; its orientation differs from the script only by the small turn of the wrist.
        let yielded = self.delayed_wrench.force * (-yielding / hand.stiffness);
        let turned = self.delayed_wrench.moment * (-yielding / hand.rotational_stiffness);
        let place = x_0_script.translation.vector + tremor + x_0_script.rotation * yielded;
        Isometry3::from_parts(
            Translation3::from(place),
            x_0_script.rotation * UnitQuaternion::from_scaled_axis(turned),
        )
    }
}

/// Returns the fraction of a first-order step response reached after `dt` s.
fn first_order(dt: f64, time_constant: f64) -> f64 {
    -(-dt / time_constant).exp_m1()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::tremor::Shake;
    use units::spatial::Twist;

    const MS: f64 = 1e-3;

    fn still(settings: OperatorSettings) -> OperatorModel {
        let shake = Shake { amplitude: 0.0, ..settings.shake };
        OperatorModel::new(OperatorSettings { shake, ..settings }, 1)
    }

    fn pull(newtons: f64) -> Wrench {
        Wrench::from_components([newtons, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    /// Returns the grasp after `ms` of a constant wrench.
    fn after(operator: &mut OperatorModel, ms: u32, felt: Wrench) -> Option<Grasp> {
        let here = Isometry3::identity();
        (0..ms).fold(None, |_, _| operator.step(MS, &here, true, &felt))
    }

    #[test]
    fn steady_operator_follows_the_script_under_load() {
        let mut operator = still(OperatorSettings::STEADY);
        let x_0_script = Isometry3::new([0.3, 0.1, -0.2].into(), [0.3, -0.2, 0.1].into());
        let felt = Wrench::from_components([30.0, -5.0, 3.0, 1.0, 0.5, -0.2]);
        for _ in 0..500 {
            let grasp = operator.step(MS, &x_0_script, true, &felt).unwrap();
            assert_eq!(grasp, Grasp { hand: Hand::default(), x_0_d: x_0_script });
        }
    }

    #[test]
    fn reaction_starts_after_the_reaction_time() {
        for settings in
            [OperatorSettings::RELAXED, OperatorSettings::FIRM, OperatorSettings::NERVOUS]
        {
            let calm = OperatorSettings { startle: None, ..settings };
            let reaction = Duration::from_secs_f64(calm.reaction).as_millis().try_into().unwrap();
            let mut operator = still(calm);
            let before = after(&mut operator, reaction, pull(10.0)).unwrap();
            assert_eq!(before, Grasp { hand: calm.hand, x_0_d: Isometry3::identity() });
            let later = after(&mut operator, 100, pull(10.0)).unwrap();
            assert_ne!(later, before);
        }
    }

    #[test]
    fn relaxed_operator_yields_to_a_constant_force() {
        let settings = OperatorSettings::RELAXED;
        let mut operator = still(settings);
        let x_0_g = Isometry3::translation(-0.02, 0.0, 0.0);
        let x_0_script = Isometry3::identity();
        let mut felt = Wrench::ZERO;
        for _ in 0..4_000 {
            let Grasp { hand, x_0_d } = operator.step(MS, &x_0_script, true, &felt).unwrap();
            felt = hand.wrench(&x_0_g, &Twist::ZERO, &x_0_d);
        }
        let alone = settings.hand.stiffness * 0.02;
        assert!((felt.force.x - alone / (1.0 + settings.yielding)).abs() < 1e-3, "{felt:?}");
    }

    #[test]
    fn firm_operator_stiffens_up_to_its_limit() {
        let settings = OperatorSettings::FIRM;
        let stiffness = |newtons| {
            let mut operator = still(settings);
            after(&mut operator, 1_000, pull(newtons)).unwrap().hand.stiffness
        };
        let most = settings.hand.stiffness * (1.0 + settings.stiffening);
        assert!((stiffness(0.0) - settings.hand.stiffness).abs() < 1e-9);
        assert!(stiffness(20.0) > settings.hand.stiffness && stiffness(20.0) < most);
        assert!((stiffness(1e3) - most).abs() < 1e-3);
    }

    #[test]
    fn jerk_startles_and_slow_force_does_not() {
        let settings = OperatorSettings::NERVOUS;
        let mut jerked = still(settings);
        assert!(after(&mut jerked, 150, pull(20.0)).is_some());
        assert!(after(&mut jerked, 2, pull(20.0)).is_none() && jerked.is_startled());
        let mut pressed = still(settings);
        let slowly = (0..4_000).map(f64::from).all(|ms| {
            let felt = pull(20.0 * (ms / 2_000.0).min(1.0));
            pressed.step(MS, &Isometry3::identity(), true, &felt).is_some()
        });
        assert!(slowly);
    }

    #[test]
    fn startled_operator_holds_only_after_release() {
        let mut operator = still(OperatorSettings::NERVOUS);
        let here = Isometry3::identity();
        assert!(after(&mut operator, 200, pull(20.0)).is_none());
        assert!(after(&mut operator, 2_000, Wrench::ZERO).is_none());
        assert!(operator.step(MS, &here, false, &Wrench::ZERO).is_none());
        assert!(operator.step(MS, &here, true, &Wrench::ZERO).is_some());
    }

    proptest! {
        #[test]
        fn yielding_is_bounded_by_the_largest_force(
            pulls in prop::collection::vec(-15.0..15.0_f64, 1..50), steps in 1..20_u32
        ) {
            let mut operator = still(OperatorSettings::RELAXED);
            let OperatorSettings { hand, yielding, .. } = OperatorSettings::RELAXED;
            let most = pulls.iter().fold(0.0_f64, |most, pull| most.max(pull.abs()));
            for newtons in pulls {
                let grasp = after(&mut operator, steps, pull(newtons)).unwrap();
                let yielded = grasp.x_0_d.translation.vector.norm();
                prop_assert!(yielded <= yielding * most / hand.stiffness + 1e-12);
            }
        }
    }
}
