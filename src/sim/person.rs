//! The operator: a [hand](crate::hand) that follows its script late, shakes, answers late what it
//! feels, and may let go.
//!
//! What the hand feels reaches its will after the temperament's reaction time, and its muscles take a
//! little longer to act (Zajac 1989). Then, `f` being the wrench known by then, `K` its stiffness:
//!
//! ```text
//!  it gives way   by  yielding · f / K, so that in the end it pulls 1 / (1 + yielding) as hard
//!  it stiffens    to  K (1 + stiffening · |f| / largest pull), and its damping by the root of that
//!  it lets go     when f differs by more than its startle from what it has got used to
//! ```
//!
//! A hand that was startled is off the grip, and off the deadman switch in it, until its script has told
//! it to let go and to take hold again.

use nalgebra::Isometry3;
use nalgebra::Translation3;
use nalgebra::UnitQuaternion;
use nalgebra::Vector3;

use crate::delay::Delay;
use crate::hand::Hand;
use crate::temperament::Temperament;
use crate::tremor::Tremor;
use units::spatial::Wrench;

/// How fast muscles take up what they are told, in s.
const MUSCLES: f64 = 0.05;

/// How fast a hand gets used to a force, in s.
const HABIT: f64 = 0.25;

/// A hand on the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grasp {
    /// Its impedance now.
    pub hand: Hand,
    /// Where it wants the grip.
    pub x_0_d: Isometry3<f64>,
}

/// One operator.
#[derive(Clone, Debug)]
pub struct Person {
    temperament: Temperament,
    tremor: Tremor,
    nerves: Delay,
    /// The wrench on the grip that the muscles answer, at {G} in {G}.
    answered: Wrench,
    /// The force on the grip it has got used to, in {G}, in N.
    used_to: Vector3<f64>,
    is_startled: bool,
}

impl Person {
    /// Of this temperament, with the tremor of `seed`.
    pub fn new(temperament: Temperament, seed: u64) -> Self {
        Self {
            temperament,
            tremor: Tremor::new(temperament.shake, seed),
            nerves: Delay::new(temperament.reaction),
            answered: Wrench::ZERO,
            used_to: Vector3::zeros(),
            is_startled: false,
        }
    }

    /// How late it follows its script, in s.
    pub const fn reaction(&self) -> f64 {
        self.temperament.reaction
    }

    /// Whether it has let go by itself.
    pub const fn is_startled(&self) -> bool {
        self.is_startled
    }

    /// How it holds for the next `dt` s, `None` when not at all: meaning the grip to be at `x_0_meant`,
    /// told to hold it or not, and feeling `f_g`, its own wrench on the grip, at {G} in {G}.
    pub fn act(
        &mut self,
        dt: f64,
        x_0_meant: &Isometry3<f64>,
        is_told_to_hold: bool,
        f_g: &Wrench,
    ) -> Option<Grasp> {
        self.feel(dt, f_g, is_told_to_hold);
        let shaking = self.tremor.next(dt);
        let grasp = Grasp { hand: self.hand(), x_0_d: self.aim(x_0_meant, &shaking) };
        (is_told_to_hold && !self.is_startled).then_some(grasp)
    }

    fn feel(&mut self, dt: f64, f_g: &Wrench, is_told_to_hold: bool) {
        let known = self.nerves.pass(dt, *f_g);
        self.answered = self.answered + (known - self.answered) * approach(dt, MUSCLES);
        let surprise = known.force - self.used_to;
        self.used_to += surprise * approach(dt, HABIT);
        let is_jerked = self.temperament.startle.is_some_and(|most| surprise.norm() > most);
        self.is_startled = is_told_to_hold && (self.is_startled || is_jerked);
    }

    /// Its impedance with the muscles as tense as they are.
    fn hand(&self) -> Hand {
        let Temperament { hand, stiffening, .. } = self.temperament;
        let effort = (self.answered.force.norm() / hand.max_force).min(1.0);
        hand.stiffened(1.0 + stiffening * effort)
    }

    /// Where it wants the grip: where it is meant to be, shaken, and having given way.
    fn aim(&self, x_0_meant: &Isometry3<f64>, shaking: &Vector3<f64>) -> Isometry3<f64> {
        let Temperament { hand, yielding, .. } = self.temperament;
        // {G} is turned as it is meant to be, but for the give of the wrist.
        let given = self.answered.force * (-yielding / hand.stiffness);
        let turned = self.answered.moment * (-yielding / hand.turning_stiffness);
        let place = x_0_meant.translation.vector + shaking + x_0_meant.rotation * given;
        Isometry3::from_parts(
            Translation3::from(place),
            x_0_meant.rotation * UnitQuaternion::from_scaled_axis(turned),
        )
    }
}

/// The share of the way to its end that something of this time constant goes in `dt` s.
fn approach(dt: f64, time_constant: f64) -> f64 {
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

    fn still(temperament: Temperament) -> Person {
        let shake = Shake { amplitude: 0.0, ..temperament.shake };
        Person::new(Temperament { shake, ..temperament }, 1)
    }

    fn pull(newtons: f64) -> Wrench {
        Wrench::from_components([newtons, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    /// How it holds after so many ms of a pull.
    fn after(person: &mut Person, ms: u32, felt: Wrench) -> Option<Grasp> {
        let here = Isometry3::identity();
        (0..ms).fold(None, |_, _| person.act(MS, &here, true, &felt))
    }

    #[test]
    fn a_steady_hand_is_where_it_is_meant_to_be_whatever_it_feels() {
        let mut person = still(Temperament::STEADY);
        let x_0_meant = Isometry3::new([0.3, 0.1, -0.2].into(), [0.3, -0.2, 0.1].into());
        let felt = Wrench::from_components([30.0, -5.0, 3.0, 1.0, 0.5, -0.2]);
        for _ in 0..500 {
            let grasp = person.act(MS, &x_0_meant, true, &felt).unwrap();
            assert_eq!(grasp, Grasp { hand: Hand::default(), x_0_d: x_0_meant });
        }
    }

    #[test]
    fn an_answer_comes_a_reaction_time_after_what_it_answers_and_not_before() {
        for temperament in [Temperament::RELAXED, Temperament::FIRM, Temperament::NERVOUS] {
            let calm = Temperament { startle: None, ..temperament };
            let reaction = Duration::from_secs_f64(calm.reaction).as_millis().try_into().unwrap();
            let mut person = still(calm);
            let before = after(&mut person, reaction, pull(10.0)).unwrap();
            assert_eq!(before, Grasp { hand: calm.hand, x_0_d: Isometry3::identity() });
            let later = after(&mut person, 100, pull(10.0)).unwrap();
            assert_ne!(later, before);
        }
    }

    #[test]
    fn a_relaxed_hand_held_off_ends_up_pulling_by_its_share_less() {
        let temperament = Temperament::RELAXED;
        let mut person = still(temperament);
        let x_0_g = Isometry3::translation(-0.02, 0.0, 0.0);
        let x_0_meant = Isometry3::identity();
        let mut felt = Wrench::ZERO;
        for _ in 0..4_000 {
            let Grasp { hand, x_0_d } = person.act(MS, &x_0_meant, true, &felt).unwrap();
            felt = hand.wrench(&x_0_g, &Twist::ZERO, &x_0_d);
        }
        let alone = temperament.hand.stiffness * 0.02;
        assert!((felt.force.x - alone / (1.0 + temperament.yielding)).abs() < 1e-3, "{felt:?}");
    }

    #[test]
    fn a_firm_hand_stiffens_with_its_effort_and_no_more_than_it_can() {
        let temperament = Temperament::FIRM;
        let stiffness = |newtons| {
            let mut person = still(temperament);
            after(&mut person, 1_000, pull(newtons)).unwrap().hand.stiffness
        };
        let most = temperament.hand.stiffness * (1.0 + temperament.stiffening);
        assert!((stiffness(0.0) - temperament.hand.stiffness).abs() < 1e-9);
        assert!(stiffness(20.0) > temperament.hand.stiffness && stiffness(20.0) < most);
        assert!((stiffness(1e3) - most).abs() < 1e-3);
    }

    #[test]
    fn a_jerk_startles_late_and_the_same_force_taken_up_slowly_does_not() {
        let temperament = Temperament::NERVOUS;
        let mut jerked = still(temperament);
        assert!(after(&mut jerked, 150, pull(20.0)).is_some());
        assert!(after(&mut jerked, 2, pull(20.0)).is_none() && jerked.is_startled());
        let mut pressed = still(temperament);
        let slowly = (0..4_000).map(f64::from).all(|ms| {
            let felt = pull(20.0 * (ms / 2_000.0).min(1.0));
            pressed.act(MS, &Isometry3::identity(), true, &felt).is_some()
        });
        assert!(slowly);
    }

    #[test]
    fn a_startled_hand_takes_hold_again_only_when_told_anew() {
        let mut person = still(Temperament::NERVOUS);
        let here = Isometry3::identity();
        assert!(after(&mut person, 200, pull(20.0)).is_none());
        assert!(after(&mut person, 2_000, Wrench::ZERO).is_none());
        assert!(person.act(MS, &here, false, &Wrench::ZERO).is_none());
        assert!(person.act(MS, &here, true, &Wrench::ZERO).is_some());
    }

    proptest! {
        #[test]
        fn it_never_gives_way_farther_than_what_it_felt_pushed_it(
            pulls in prop::collection::vec(-15.0..15.0_f64, 1..50), steps in 1..20_u32
        ) {
            let mut person = still(Temperament::RELAXED);
            let Temperament { hand, yielding, .. } = Temperament::RELAXED;
            let most = pulls.iter().fold(0.0_f64, |most, pull| most.max(pull.abs()));
            for newtons in pulls {
                let grasp = after(&mut person, steps, pull(newtons)).unwrap();
                let given = grasp.x_0_d.translation.vector.norm();
                prop_assert!(given <= yielding * most / hand.stiffness + 1e-12);
            }
        }
    }
}
