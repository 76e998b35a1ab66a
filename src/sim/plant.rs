//! The arm in motion: motors, friction, end stops and a hand, integrated in small fixed steps.
//!
//! What resists motion already resists the velocities `v` at the end of each step, so a firm hand on a
//! light wrist and a hard stop stay stable (time stepping after Stewart and Trinkle 1996):
//!
//! ```text
//!  (M + h D + h² K) v + h c sgn(v) = M qd + h (tau - bias + Jᵀ f_g)
//! ```
//!
//! At `v` = 0 the sign is any number within ±1: a joint that dry friction can hold does not creep.

use nalgebra::Isometry3;

use crate::sim::arm::Arm;
use crate::sim::arm::JointMatrix;
use crate::sim::arm::Joints;
use crate::sim::arm::Posture;
use crate::sim::hand::Hand;
use crate::spatial::Jacobian;
use crate::spatial::Twist;
use crate::spatial::Wrench;

/// The longest step, in s.
const STEP: f64 = 250e-6;

/// A rest of time this short is a rounding error, in s.
const ROUNDING: f64 = 1e-9;

/// An end stop's spring, in N·m/rad (N/m for a sliding joint).
const STOP_STIFFNESS: f64 = 20e3;

/// An end stop's damper, in N·m·s/rad (N·s/m).
const STOP_DAMPING: f64 = 60.0;

/// Velocities that a sweep changes by less are settled, in rad/s (m/s).
const SETTLED: f64 = 1e-9;

/// The most sweeps of one step; a handful is usual.
const SWEEPS: usize = 100;

/// What one joint's motion meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    /// Dry friction, in N·m.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad.
    pub viscous: f64,
    /// Where its end stops are, in rad (m).
    pub range: [f64; 2],
}

impl Resistance {
    /// The velocity after `h` s of a joint at `q` whose `inertia` has got `momentum`, against friction
    /// and, if it would end up beyond one, an end stop. A stop never pulls.
    fn velocity(&self, h: f64, q: f64, inertia: f64, momentum: f64) -> f64 {
        let inertia = inertia + h * self.viscous;
        let free = beyond(momentum, h * self.coulomb) / inertia;
        let end = self.past_stop(q + h * free);
        if end.abs() <= 0.0 {
            return free;
        }
        let to_stop = end - h * free; // how far past it is without moving; negative if not yet there
        let push = beyond(momentum - h * STOP_STIFFNESS * to_stop, h * self.coulomb);
        let is_pressed = self.past_stop(q) * push > 0.0;
        let damping = if is_pressed { STOP_DAMPING } else { 0.0 };
        push / (inertia + h * damping + h * h * STOP_STIFFNESS)
    }

    /// How far `q` is past the upper stop or, negative, the lower one; zero between them.
    fn past_stop(&self, q: f64) -> f64 {
        let [low, high] = self.range;
        (q - high).max(0.0) + (q - low).min(0.0)
    }
}

/// An arm in motion.
#[derive(Clone, Copy, Debug)]
pub struct Plant {
    arm: Arm,
    resistance: [Resistance; 6],
    q: Joints,
    qd: Joints,
    posture: Posture,
    x_0_g: Isometry3<f64>,
    f_g_hand: Wrench,
}

impl Plant {
    /// At rest at `q`.
    pub fn new(arm: Arm, resistance: [Resistance; 6], q: Joints) -> Self {
        let posture = arm.posture(&q);
        let x_0_g = arm.pose(&posture);
        Self { arm, resistance, q, qd: Joints::zeros(), posture, x_0_g, f_g_hand: Wrench::ZERO }
    }

    /// Joint positions, in rad.
    pub const fn q(&self) -> &Joints {
        &self.q
    }

    /// Joint velocities, in rad/s.
    pub const fn qd(&self) -> &Joints {
        &self.qd
    }

    /// The pose of the grip.
    pub const fn x_0_g(&self) -> &Isometry3<f64> {
        &self.x_0_g
    }

    /// The wrench of the hand on the grip, at {G} in {G}.
    pub const fn f_g_hand(&self) -> &Wrench {
        &self.f_g_hand
    }

    /// Lets `dt` s pass with motor torques `tau` and, if it holds the grip, a hand that wants it
    /// somewhere.
    pub fn advance(&mut self, dt: f64, tau: &Joints, hand: Option<(&Hand, &Isometry3<f64>)>) {
        let mut left = dt;
        while left > ROUNDING {
            let h = left.min(STEP);
            self.step(h, tau, hand);
            left -= h;
        }
    }

    fn step(&mut self, h: f64, tau: &Joints, hand: Option<(&Hand, &Isometry3<f64>)>) {
        let mut inertia = self.arm.mass_matrix(&self.posture);
        let push = tau - self.arm.bias(&self.posture, &self.qd);
        let mut momentum = inertia * self.qd + push * h;
        self.f_g_hand = Wrench::ZERO;
        if let Some((hand, x_0_d)) = hand {
            let j_g = self.arm.jacobian(&self.posture);
            let v_g = j_g.twist(&self.qd);
            self.f_g_hand = hand.wrench(&self.x_0_g, &v_g, x_0_d);
            // The damper acts on the velocity to come, not on the one that was.
            let undamped = self.f_g_hand + damping(hand, &v_g);
            momentum += j_g.torques(&undamped) * h;
            inertia += yielding(&j_g, h, hand);
        }
        self.qd = self.velocities(h, &inertia, &momentum);
        self.q += self.qd * h;
        self.posture = self.arm.posture(&self.q);
        self.x_0_g = self.arm.pose(&self.posture);
    }

    /// The velocities that `momentum` gives to `inertia`, friction and stops resisting. They minimise a
    /// strictly convex function, and going from joint to joint, each minimising its own part, gets there.
    #[expect(clippy::indexing_slicing, reason = "joints are numbered by enumerating them")]
    fn velocities(&self, h: f64, inertia: &JointMatrix, momentum: &Joints) -> Joints {
        let mut qd = self.qd;
        for _ in 0..SWEEPS {
            let mut change = 0.0_f64;
            for (joint, resistance) in self.resistance.iter().enumerate() {
                let own = inertia[(joint, joint)];
                let others = inertia.column(joint).dot(&qd) - own * qd[joint];
                let before = qd[joint];
                qd[joint] = resistance.velocity(h, self.q[joint], own, momentum[joint] - others);
                change = change.max((qd[joint] - before).abs());
            }
            if change < SETTLED {
                break;
            }
        }
        qd
    }
}

/// How far `value` reaches out of the band ±`dry`: dry friction takes the rest.
fn beyond(value: f64, dry: f64) -> f64 {
    value - value.clamp(-dry, dry)
}

/// What the hand's damper takes from its pull at `v_g`.
fn damping(hand: &Hand, v_g: &Twist) -> Wrench {
    let taken = v_g.scaled(&hand.dampings());
    Wrench { force: taken.linear, moment: taken.angular }
}

/// What the hand's damper and spring add to the inertia, as they act at the end of the step:
/// `Jᵀ (h D + h² K) J`.
fn yielding(j_g: &Jacobian<6>, h: f64, hand: &Hand) -> JointMatrix {
    let ([d_linear, .., d_angular], [k_linear, .., k_angular]) =
        (hand.dampings(), hand.stiffnesses());
    j_g.linear.tr_mul(&j_g.linear) * (h * (d_linear + h * k_linear))
        + j_g.angular.tr_mul(&j_g.angular) * (h * (d_angular + h * k_angular))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::arm;
    use proptest::prelude::*;

    const NEUTRAL: [f64; 6] = [0.0, -0.873, 1.658, -0.785, 0.0, 0.0];
    const COULOMB: [f64; 6] = [0.06, 0.06, 0.04, 0.012, 0.01, 0.008];
    const STRENGTH: [f64; 6] = [6.0, 6.0, 4.0, 1.2, 1.0, 0.8];
    const RANGES: [[f64; 2]; 6] =
        [[-1.22, 1.22], [-1.75, 0.7], [0.0, 2.44], [-1.4, 1.4], [-1.22, 1.22], [-2.79, 2.79]];

    /// At rest at neutral, with `share` of the friction of kraft_like.
    fn plant(share: f64) -> Plant {
        let joint = |(coulomb, range): (f64, [f64; 2])| Resistance {
            coulomb: coulomb * share,
            viscous: 0.4 * coulomb * share,
            range,
        };
        let resistance = std::array::from_fn(|place| joint((COULOMB[place], RANGES[place])));
        Plant::new(arm::tests::kraft_like(), resistance, Joints::from(NEUTRAL))
    }

    fn weight(plant: &Plant) -> Joints {
        plant.arm.gravity(&plant.posture)
    }

    fn kinetic(plant: &Plant) -> f64 {
        plant.qd.dot(&(plant.arm.mass_matrix(&plant.posture) * plant.qd)) / 2.0
    }

    fn joints(size: f64) -> impl Strategy<Value = [f64; 6]> {
        prop::array::uniform6(-size..size)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        #[test]
        fn torque_that_dry_friction_can_hold_moves_nothing_at_all(part in joints(0.99)) {
            let mut plant = plant(1.0);
            let excess = Joints::from(COULOMB).component_mul(&Joints::from(part));
            plant.advance(0.05, &(weight(&plant) + excess), None);
            prop_assert_eq!(plant.q, Joints::from(NEUTRAL));
        }

        #[test]
        fn friction_brings_everything_to_rest_and_adds_no_energy(qd in joints(1.0)) {
            let mut plant = plant(10.0);
            plant.qd = Joints::from(qd);
            let mut before = kinetic(&plant);
            for _ in 0..400 {
                let tau = weight(&plant);
                plant.advance(1e-3, &tau, None);
                let after = kinetic(&plant);
                prop_assert!(after <= before * 1.001, "{} J appeared", after - before);
                before = after;
            }
            prop_assert_eq!(plant.qd, Joints::zeros());
        }

        #[test]
        fn no_drive_is_strong_enough_for_an_end_stop(signs in prop::array::uniform6(any::<bool>())) {
            let mut plant = plant(1.0);
            let push = |place: usize| if signs[place] { STRENGTH[place] } else { -STRENGTH[place] };
            let tau = Joints::from(std::array::from_fn::<f64, 6, _>(push));
            for _ in 0..400 {
                plant.advance(1e-3, &tau, None);
                for (q, resistance) in plant.q.iter().zip(&plant.resistance) {
                    let past = resistance.past_stop(*q);
                    prop_assert!(past.abs() < 0.03, "{past} rad past {:?}", resistance.range);
                }
            }
        }

        #[test]
        fn no_hand_however_firm_shakes_the_light_wrist(
            firmness in 1.0..100.0_f64, turn in joints(0.2)
        ) {
            let mut plant = plant(1.0);
            let hand = Hand {
                stiffness: 500.0 * firmness,
                damping: 15.0 * firmness,
                turning_stiffness: 6.0 * firmness,
                turning_damping: 0.12 * firmness,
                max_force: 1e6,
                max_moment: 1e6,
            };
            let goal = plant.arm.posture(&(plant.q + Joints::from(turn)));
            let x_0_d = plant.arm.pose(&goal);
            plant.advance(0.8, &Joints::zeros(), Some((&hand, &x_0_d)));
            prop_assert!(plant.qd.amax() < 1e-6, "{} rad/s", plant.qd.amax());
        }
    }

    #[test]
    fn torque_beyond_dry_friction_turns_its_joint() {
        let mut plant = plant(1.0);
        let tau = weight(&plant) + Joints::ith(5, 1.5 * COULOMB[5]);
        plant.advance(0.05, &tau, None);
        assert!(plant.q[5] > NEUTRAL[5] && plant.qd[5] > 0.0);
    }

    #[test]
    fn an_end_stop_lets_go_at_once() {
        let leaving = |range| {
            let resistance = Resistance { coulomb: 0.0, viscous: 0.0, range };
            resistance.velocity(STEP, 1e-4, 0.1, -0.1)
        };
        assert!((leaving([-1.0, 0.0]) - leaving([-1.0, 1.0])).abs() < 1e-12);
    }

    #[test]
    fn a_joint_pressed_on_its_stop_rests_where_the_spring_says() {
        let mut plant = plant(1.0);
        let tau = |plant: &Plant| weight(plant) + Joints::ith(5, STRENGTH[5]);
        for _ in 0..1_500 {
            let tau = tau(&plant);
            plant.advance(1e-3, &tau, None);
        }
        let spring = plant.resistance[5].past_stop(plant.q[5]) * STOP_STIFFNESS;
        assert!((spring - STRENGTH[5]).abs() <= COULOMB[5] + 1e-3, "{spring} N·m");
        assert!(plant.qd.amax() < 1e-9, "{} rad/s", plant.qd.amax());
    }

    #[test]
    fn a_hand_carries_the_arm_and_is_felt_by_the_same_wrench() {
        let mut plant = plant(0.0);
        let hand = Hand::default();
        let x_0_d = *plant.x_0_g();
        plant.advance(2.0, &Joints::zeros(), Some((&hand, &x_0_d)));
        let j_g = plant.arm.jacobian(&plant.posture);
        let unbalanced = weight(&plant) - j_g.torques(plant.f_g_hand());
        assert!(unbalanced.norm() < 0.01 * weight(&plant).norm(), "{unbalanced}");
        plant.advance(0.1, &Joints::zeros(), None);
        assert_eq!(*plant.f_g_hand(), Wrench::ZERO);
        assert!(plant.x_0_g().translation.z < x_0_d.translation.z - 0.01, "it does not fall");
    }

    #[test]
    fn falling_without_friction_nearly_keeps_its_energy() {
        let mut plant = plant(0.0);
        let mut work = 0.0;
        for _ in 0..1_000 {
            let (weight_before, q_before) = (weight(&plant), plant.q);
            plant.advance(STEP, &Joints::zeros(), None);
            work -= (weight_before + weight(&plant)).dot(&(plant.q - q_before)) / 2.0;
        }
        let energy = kinetic(&plant);
        assert!(energy > 0.1, "it hardly fell: {energy} J");
        assert!((energy - work).abs() < 0.01 * energy, "{energy} J from {work} J");
    }

    #[test]
    fn a_millisecond_is_four_steps_bit_for_bit() {
        let (hand, x_0_d) = (Hand::default(), Isometry3::translation(0.4, 0.0, 0.1));
        let (mut whole, mut parts) = (plant(1.0), plant(1.0));
        for _ in 0..50 {
            whole.advance(1e-3, &Joints::zeros(), Some((&hand, &x_0_d)));
            for _ in 0..4 {
                parts.advance(STEP, &Joints::zeros(), Some((&hand, &x_0_d)));
            }
        }
        assert_eq!((whole.q, whole.qd), (parts.q, parts.qd));
        assert!(whole.q != Joints::from(NEUTRAL));
    }
}
