//! Arm in motion: motors, friction, end stops and a hand, integrated in small fixed steps.
//!
//! A step has two parts. The first finds the resisting torques for the velocities `v` at the end of the step (time
//! stepping after Stewart and Trinkle 1996). So a firm hand on a light wrist and a hard stop are stable:
//!
//! ```text
//!  (M + h D + h² K) v + h c sgn(v) = M qd + h (tau - bias + Jᵀ f_g)
//! ```
//!
//! At `v` = 0 the sign is any number within ±1: a joint that dry friction can hold does not creep. The second part
//! holds these resisting torques `r` constant and integrates the dynamics by a fourth-order Runge-Kutta step (Hairer,
//! Nørsett, Wanner 1993, II.1):
//!
//! ```text
//!  M(q) qdd + bias(q, qd) = tau + r
//! ```
//!
//! Without resistance `r` is zero, and energy is conserved to the fifth order of the step. Joints that dry friction
//! holds are locked meanwhile. For one mass both parts multiply its state by a matrix of determinant
//! `(1 + κ/2) / (1 + κ + δ)` and trace `1 + (1 - κ/2) / (1 + κ + δ)`, with `κ = h² k / m` and `δ = h d / m`: stable
//! for every spring and damper.

mod resistance;

pub use resistance::Resistance;

use nalgebra::Isometry3;

use crate::arm::{self, Arm, Dynamics, JointMatrix, Joints, Posture};
use crate::hand::Hand;
use units::spatial::{Jacobian, Twist, Wrench};

/// Maximum step, in s.
const MAX_STEP: f64 = 500e-6;

/// Remainder of time that counts as zero, in s.
const ROUNDING: f64 = 1e-9;

/// Change of velocity at which the iteration has converged, in rad/s (m/s).
const CONVERGED: f64 = 1e-9;

/// Maximum iterations per step; a handful is usual.
const MAX_SWEEPS: usize = 100;

/// Splits `dt` s into steps, in s.
pub fn steps(dt: f64) -> impl Iterator<Item = f64> {
    let mut left = dt;
    std::iter::from_fn(move || {
        let h = left.min(MAX_STEP);
        left -= h;
        (h > ROUNDING).then_some(h)
    })
}

/// Arm in motion.
#[derive(Clone, Copy, Debug)]
pub struct Plant {
    arm: Arm,
    resistance: [Resistance; 6],
    q: Joints,
    qd: Joints,
    posture: Posture,
    x_0_g: Isometry3<f64>,
    f_g_hand: Wrench,
    /// Torques of motors, and of friction and end stops, in the last step.
    tau: Joints,
    tau_resisting: Joints,
}

/// Equilibrium of the joints in the last step, in N·m (N):
/// `motors + resisting + hand = gravity + inertia`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Torques of the motors.
    pub motors: Joints,
    /// Torques of friction and end stops on the joints.
    pub resisting: Joints,
    /// Torques of the hand on the joints.
    pub hand: Joints,
    /// Torques that balance gravity.
    pub gravity: Joints,
    /// Torques of acceleration, Coriolis and centrifugal forces: the remainder.
    pub inertia: Joints,
}

/// Hand with its desired pose of the grip.
pub type Grasp<'h> = (&'h Hand, &'h Isometry3<f64>);

impl Plant {
    /// Creates a plant at rest at `q`.
    pub fn new(arm: Arm, resistance: [Resistance; 6], q: Joints) -> Self {
        let posture = arm.posture(&q);
        let x_0_g = arm.pose(&posture);
        Self {
            arm,
            resistance,
            q,
            qd: Joints::zeros(),
            posture,
            x_0_g,
            f_g_hand: Wrench::ZERO,
            tau: Joints::zeros(),
            tau_resisting: Joints::zeros(),
        }
    }

    /// Returns the equilibrium of the last step; `j_g` is the present [Jacobian](Self::jacobian).
    pub fn balance(&self, j_g: &Jacobian<6>) -> Balance {
        let hand = j_g.torques(&self.f_g_hand);
        let gravity = self.arm.gravity(&self.posture);
        let (motors, resisting) = (self.tau, self.tau_resisting);
        Balance { motors, resisting, hand, gravity, inertia: motors + resisting + hand - gravity }
    }

    /// Returns the torques that give the joints these accelerations, in N·m (N), without friction and end stops.
    pub fn torques_for(&self, acceleration: &Joints) -> Joints {
        let Dynamics { mass, bias } = self.arm.dynamics(&self.posture, &self.qd);
        mass * acceleration + bias
    }

    /// Returns which joints are prismatic.
    pub fn is_prismatic(&self) -> [bool; 6] {
        self.arm.is_prismatic()
    }

    /// Returns the Jacobian of {G} in {G}.
    pub fn jacobian(&self) -> Jacobian<6> {
        self.arm.jacobian(&self.posture)
    }

    /// Returns the joint positions, in rad or m.
    pub const fn q(&self) -> &Joints {
        &self.q
    }

    /// Returns the joint velocities, in rad/s or m/s.
    pub const fn qd(&self) -> &Joints {
        &self.qd
    }

    /// Returns the pose of the grip.
    pub const fn x_0_g(&self) -> &Isometry3<f64> {
        &self.x_0_g
    }

    /// Returns the wrench of the hand on the grip, at {G} in {G}.
    pub const fn f_g_hand(&self) -> &Wrench {
        &self.f_g_hand
    }

    /// Returns the kinetic and potential energy of the arm, in J, without that of the end stops.
    pub fn energy(&self) -> f64 {
        self.arm.energy(&self.posture, &self.qd)
    }

    /// Advances by `dt` s with motor torques `tau`, and a hand if it holds the grip.
    pub fn advance(&mut self, dt: f64, tau: &Joints, hand: Option<Grasp<'_>>) {
        for h in steps(dt) {
            self.step(h, tau, hand);
        }
    }

    /// Advances by one of the [`steps`].
    pub fn step(&mut self, h: f64, tau: &Joints, hand: Option<Grasp<'_>>) {
        let Dynamics { mass, bias } = self.arm.dynamics(&self.posture, &self.qd);
        let mut momentum = mass * self.qd + (tau - bias) * h;
        let mut yielding = JointMatrix::zeros();
        let mut pull = Joints::zeros();
        self.f_g_hand = Wrench::ZERO;
        if let Some((hand, x_0_d)) = hand {
            let j_g = self.arm.jacobian(&self.posture);
            let v_g = j_g.twist(&self.qd);
            self.f_g_hand = hand.wrench(&self.x_0_g, &v_g, x_0_d);
            // The damper acts on the velocity at the end of the step.
            pull = j_g.torques(&(self.f_g_hand + damping(hand, &v_g)));
            momentum += pull * h;
            yielding = inertia_of(&j_g, h, hand);
        }
        let (v, impulse) = self.resist(h, &(mass + yielding), &momentum);
        let r = impulse / h + pull - yielding * v / h;
        (self.tau, self.tau_resisting) = (*tau, impulse / h);
        let held = self.held(&v);
        let first = arm::accelerations(mass, &(tau + r - bias), &held);
        self.integrate(h, &(tau + r), first, &held);
        // A joint that friction stops is at rest at the end of the step.
        for ((qd, v), resistance) in self.qd.iter_mut().zip(v.iter()).zip(&self.resistance) {
            if resistance.can_hold() && v.abs() <= 0.0 {
                *qd = 0.0;
            }
        }
        self.posture = self.arm.posture(&self.q);
        self.x_0_g = self.arm.pose(&self.posture);
    }

    /// Returns the joints that rest, and stay at rest if `v` is the velocity at the end of the step.
    fn held(&self, v: &Joints) -> [bool; 6] {
        let mut held = [false; 6];
        let joints = self.resistance.iter().zip(self.qd.iter()).zip(v.iter());
        for (held, ((resistance, qd), v)) in held.iter_mut().zip(joints) {
            *held = resistance.can_hold() && qd.abs() <= 0.0 && v.abs() <= 0.0;
        }
        held
    }

    /// Integrates the dynamics for `h` s with torques `tau`; `a_1` is the initial acceleration.
    fn integrate(&mut self, h: f64, tau: &Joints, a_1: Joints, held: &[bool; 6]) {
        let accelerate = |q: &Joints, qd: &Joints| {
            let Dynamics { mass, bias } = self.arm.dynamics_at(q, qd);
            arm::accelerations(mass, &(tau - bias), held)
        };
        let (q, v_1) = (self.q, self.qd);
        let v_2 = v_1 + a_1 * (h / 2.0);
        let a_2 = accelerate(&(q + v_1 * (h / 2.0)), &v_2);
        let v_3 = v_1 + a_2 * (h / 2.0);
        let a_3 = accelerate(&(q + v_2 * (h / 2.0)), &v_3);
        let v_4 = v_1 + a_3 * h;
        let a_4 = accelerate(&(q + v_3 * h), &v_4);
        self.q += (v_1 + (v_2 + v_3) * 2.0 + v_4) * (h / 6.0);
        self.qd += (a_1 + (a_2 + a_3) * 2.0 + a_4) * (h / 6.0);
    }

    /// Returns the velocities of `inertia` with `momentum` against friction and stops, and the impulses of these.
    /// Minimises a strictly convex function by coordinate descent over the joints.
    #[expect(clippy::indexing_slicing, reason = "joints are numbered by enumerating them")]
    fn resist(&self, h: f64, inertia: &JointMatrix, momentum: &Joints) -> (Joints, Joints) {
        let (mut v, mut impulse) = (self.qd, Joints::zeros());
        let dry: [f64; 6] = std::array::from_fn(|joint| self.resistance[joint].dry(self.qd[joint]));
        for _ in 0..MAX_SWEEPS {
            let mut change = 0.0_f64;
            for (joint, resistance) in self.resistance.iter().enumerate() {
                let own = inertia[(joint, joint)];
                let others = inertia.column(joint).dot(&v) - own * v[joint];
                let (before, left) = (v[joint], momentum[joint] - others);
                v[joint] = resistance.velocity(h, self.q[joint], dry[joint], [own, left]);
                impulse[joint] = own * v[joint] - left;
                change = change.max((v[joint] - before).abs());
            }
            if change < CONVERGED {
                break;
            }
        }
        (v, impulse)
    }
}

/// Returns the damping part of the hand's wrench at `v_g`.
fn damping(hand: &Hand, v_g: &Twist) -> Wrench {
    let taken = v_g.scaled(&hand.dampings());
    Wrench { force: taken.linear, moment: taken.angular }
}

/// Returns the inertia added by the hand's damper and spring at the end of the step: `Jᵀ (h D + h² K) J`.
fn inertia_of(j_g: &Jacobian<6>, h: f64, hand: &Hand) -> JointMatrix {
    let ([d_linear, .., d_angular], [k_linear, .., k_angular]) =
        (hand.dampings(), hand.stiffnesses());
    j_g.linear.tr_mul(&j_g.linear) * (h * (d_linear + h * k_linear))
        + j_g.angular.tr_mul(&j_g.angular) * (h * (d_angular + h * k_angular))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::resistance::STOP_STIFFNESS;

    const NEUTRAL: [f64; 6] = [0.0, -0.873, 1.658, -0.785, 0.0, 0.0];
    const COULOMB: [f64; 6] = [0.06, 0.06, 0.04, 0.012, 0.01, 0.008];
    const STRENGTH: [f64; 6] = [6.0, 6.0, 4.0, 1.2, 1.0, 0.8];
    const RANGES: [[f64; 2]; 6] =
        [[-1.22, 1.22], [-1.75, 0.7], [0.0, 2.44], [-1.4, 1.4], [-1.22, 1.22], [-2.79, 2.79]];

    /// Returns a plant at rest at neutral, with `share` of the friction of kraft_like.
    fn plant(share: f64) -> Plant {
        let joint = |(coulomb, range): (f64, [f64; 2])| Resistance {
            coulomb: coulomb * share,
            stiction: 0.0,
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
        fn torque_below_dry_friction_causes_no_motion(part in joints(0.99)) {
            let mut plant = plant(1.0);
            let excess = Joints::from(COULOMB).component_mul(&Joints::from(part));
            plant.advance(0.05, &(weight(&plant) + excess), None);
            prop_assert_eq!(plant.q, Joints::from(NEUTRAL));
        }

        #[test]
        fn friction_stops_all_joints_and_adds_no_energy(qd in joints(1.0)) {
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
            prop_assert_eq!(plant.qd, Joints::<6>::zeros());
        }

        #[test]
        fn end_stops_withstand_the_maximum_torque(signs in prop::array::uniform6(any::<bool>())) {
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
        fn stiff_hand_on_a_light_wrist_is_stable(
            firmness in 1.0..100.0_f64, turn in joints(0.2)
        ) {
            let mut plant = plant(1.0);
            let hand = Hand {
                stiffness: 500.0 * firmness,
                damping: 15.0 * firmness,
                rotational_stiffness: 6.0 * firmness,
                rotational_damping: 0.12 * firmness,
                max_force: 1e6,
                max_moment: 1e6,
            };
            let goal = plant.arm.posture(&(plant.q + Joints::from(turn)));
            let x_0_d = plant.arm.pose(&goal);
            // The softest hand needs 1.1 s to come to rest.
            plant.advance(1.6, &Joints::zeros(), Some((&hand, &x_0_d)));
            prop_assert!(plant.qd.amax() < 1e-6, "{} rad/s", plant.qd.amax());
        }
    }

    #[test]
    fn torque_above_dry_friction_moves_its_joint() {
        let mut plant = plant(1.0);
        let tau = weight(&plant) + Joints::ith(5, 1.5 * COULOMB[5]);
        plant.advance(0.05, &tau, None);
        assert!(plant.q[5] > NEUTRAL[5] && plant.qd[5] > 0.0);
    }

    #[test]
    fn joint_at_its_stop_rests_at_the_spring_deflection() {
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
    fn hand_carries_the_weight_of_the_arm() {
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

    /// Simulates ten seconds of free motion under gravity; returns the maximum kinetic energy and the maximum change of
    /// the total energy, in J.
    fn falling(arm: Arm, q: [f64; 6], qd: [f64; 6]) -> (f64, f64) {
        let free = Resistance { coulomb: 0.0, stiction: 0.0, viscous: 0.0, range: [-1e9, 1e9] };
        let mut plant = Plant::new(arm, [free; 6], Joints::from(q));
        plant.qd = Joints::from(qd);
        let start = plant.energy();
        let (mut fastest, mut worst) = (0.0_f64, 0.0_f64);
        for _ in 0..100 {
            plant.advance(0.1, &Joints::zeros(), None);
            fastest = fastest.max(kinetic(&plant));
            worst = worst.max((plant.energy() - start).abs());
        }
        (fastest, worst)
    }

    #[test]
    fn free_motion_conserves_energy_for_10_s() {
        let pushed = [0.5, -0.3, 0.4, 0.2, -0.6, 0.8];
        for (name, arm, q) in [
            ("kraft_like", arm::tests::kraft_like(), NEUTRAL),
            ("jpl_like", arm::tests::jpl_like(), [0.1, -0.3, 0.42, 0.2, 0.4, -0.1]),
            ("sixr_spherical", arm::tests::sixr_spherical(), [0.2, -0.4, 0.9, 0.3, -0.5, 0.1]),
        ] {
            let (fastest, worst) = falling(arm, q, pushed);
            assert!(fastest > 1.0, "{name} hardly moved: {fastest} J");
            assert!(worst < 1e-6, "{name}: {worst} J appeared or were lost of {fastest} J");
        }
    }

    #[test]
    fn advance_equals_its_steps_bit_for_bit() {
        let (hand, x_0_d) = (Hand::default(), Isometry3::translation(0.4, 0.0, 0.1));
        let (mut whole, mut parts) = (plant(1.0), plant(1.0));
        for _ in 0..50 {
            whole.advance(1e-3, &Joints::zeros(), Some((&hand, &x_0_d)));
            for _ in 0..2 {
                parts.advance(MAX_STEP, &Joints::zeros(), Some((&hand, &x_0_d)));
            }
        }
        assert_eq!((whole.q, whole.qd), (parts.q, parts.qd));
        assert!(whole.q != Joints::from(NEUTRAL));
    }
}
