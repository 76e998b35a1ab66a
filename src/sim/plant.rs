//! The arm in motion: motors, friction, end stops and a hand, integrated in small fixed steps.
//!
//! Damping and the hand's spring are taken at the end of each step, so that a firm hand on a light wrist
//! stays stable. Dry friction holds: it is what stops the joint within the step, if it is strong enough.

use nalgebra::Isometry3;
use nalgebra::SMatrix;

use crate::sim::arm::Arm;
use crate::sim::arm::Joints;
use crate::sim::hand::Hand;
use crate::spatial::Jacobian;
use crate::spatial::Twist;
use crate::spatial::Wrench;

/// The longest step, in s.
const STEP: f64 = 250e-6;

/// An end stop's spring, in N·m/rad.
const STOP_STIFFNESS: f64 = 400.0;

/// An end stop's damper, in N·m·s/rad.
const STOP_DAMPING: f64 = 1.0;

/// Dry friction is settled when it changes by less than this, in N·m.
const SETTLED: f64 = 1e-7;

/// Or after so many rounds.
const MOST_SWEEPS: u32 = 60;

/// What one joint's motion meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    /// Dry friction, in N·m.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad.
    pub viscous: f64,
    /// Where its end stops are, in rad.
    pub range: [f64; 2],
}

/// An arm in motion.
#[derive(Clone, Copy, Debug)]
pub struct Plant {
    arm: Arm,
    resistance: [Resistance; 6],
    q: Joints,
    qd: Joints,
    friction: Joints,
    x_0_g: Isometry3<f64>,
    f_g_hand: Wrench,
}

impl Plant {
    /// At rest at `q`.
    pub fn new(arm: Arm, resistance: [Resistance; 6], q: Joints) -> Self {
        let x_0_g = arm.pose(&arm.posture(&q));
        let rest = Joints::zeros();
        Self { arm, resistance, q, qd: rest, friction: rest, x_0_g, f_g_hand: Wrench::ZERO }
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
        while left > 1e-9 {
            let h = left.min(STEP);
            self.step(h, tau, hand);
            left -= h;
        }
    }

    #[expect(clippy::indexing_slicing, reason = "joints below 6 of things that are six")]
    fn step(&mut self, h: f64, tau: &Joints, hand: Option<(&Hand, &Isometry3<f64>)>) {
        let posture = self.arm.posture(&self.q);
        let j_g = self.arm.jacobian(&posture);
        let x_0_g = self.arm.pose(&posture);
        let v_g = j_g.twist(&self.qd);

        // The torques now, and how they change with the velocity at the end of the step.
        let mut push = tau - self.arm.bias(&posture, &self.qd);
        let mut inertia = self.arm.mass_matrix(&posture);
        self.f_g_hand = Wrench::ZERO;
        if let Some((hand, x_0_d)) = hand {
            self.f_g_hand = hand.wrench(&x_0_g, &v_g, x_0_d);
            push += j_g.torques(&self.f_g_hand);
            inertia += yielding(&j_g, h, hand);
            push -= spring_ahead(&j_g, h, hand, &v_g);
        }
        for joint in 0..6 {
            let Resistance { viscous, range: [low, high], .. } = self.resistance[joint];
            let (q, qd) = (self.q[joint], self.qd[joint]);
            let beyond = (q - high).max(0.0) + (q - low).min(0.0);
            let is_stopped = beyond.abs() > 0.0;
            let damping = viscous + if is_stopped { STOP_DAMPING } else { 0.0 };
            let stiffness = if is_stopped { STOP_STIFFNESS } else { 0.0 };
            push[joint] -= damping * qd + stiffness * (beyond + h * qd);
            inertia[(joint, joint)] += h * damping + h * h * stiffness;
        }

        let Some(yields) = inertia.cholesky().map(|inertia| inertia.inverse()) else { return };
        self.qd = self.rubbed(self.qd + yields * push * h, &(yields * h));
        self.q += self.qd * h;
        self.x_0_g = self.arm.pose(&self.arm.posture(&self.q));
    }
}

impl Plant {
    /// Joint rates `qd` after dry friction, where `yields` is the rate that a unit torque gives. Each
    /// joint's friction is what stops it, if it is strong enough; as the joints pull at each other, they
    /// are gone through until nothing changes any more, beginning with the friction of the step before.
    #[expect(clippy::indexing_slicing, reason = "joints below 6 of things that are six")]
    fn rubbed(&mut self, qd: Joints, yields: &SMatrix<f64, 6, 6>) -> Joints {
        let friction = &mut self.friction;
        let mut qd = qd + yields * *friction;
        for _ in 0..MOST_SWEEPS {
            let mut changed = 0.0_f64;
            for joint in 0..6 {
                let coulomb = self.resistance[joint].coulomb;
                let stopping = friction[joint] - qd[joint] / yields[(joint, joint)];
                let more = stopping.clamp(-coulomb, coulomb) - friction[joint];
                friction[joint] += more;
                qd += yields.column(joint) * more;
                changed = changed.max(more.abs());
            }
            if changed < SETTLED {
                break;
            }
        }
        qd
    }
}

/// What the hand's damper and spring add to the inertia when they are taken at the end of the step:
/// `Jᵀ (h D + h² K) J`.
fn yielding(j_g: &Jacobian<6>, h: f64, hand: &Hand) -> SMatrix<f64, 6, 6> {
    let [linear, .., angular] = ahead(h, hand);
    j_g.linear.tr_mul(&j_g.linear) * linear + j_g.angular.tr_mul(&j_g.angular) * angular
}

/// The part of the spring at the end of the step that the velocity now already gives: `Jᵀ h K v`.
fn spring_ahead(j_g: &Jacobian<6>, h: f64, hand: &Hand, v_g: &Twist) -> Joints {
    let [k, .., c] = hand.stiffnesses();
    let f_g = Wrench { force: v_g.linear * (h * k), moment: v_g.angular * (h * c) };
    j_g.torques(&f_g)
}

/// `h D + h² K`, per axis.
fn ahead(h: f64, hand: &Hand) -> [f64; 6] {
    let mut ahead = hand.dampings();
    for (ahead, stiffness) in ahead.iter_mut().zip(hand.stiffnesses()) {
        *ahead = h * (*ahead + h * stiffness);
    }
    ahead
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::arm::ArmSettings;
    use crate::sim::arm::LinkSettings;
    use nalgebra::Matrix3;
    use nalgebra::Vector3;

    /// Six joints about parallel axes: a chain that hangs, with a very light last link.
    fn plant(coulomb: f64) -> Plant {
        let link = |mass: f64| LinkSettings {
            is_prismatic: false,
            alpha: 0.0,
            a: 0.1,
            d: 0.0,
            theta: 0.0,
            mass,
            centre_of_mass: Vector3::new(0.05, 0.0, 0.0),
            inertia: Matrix3::identity() * (mass * 1e-3),
            rotor_inertia: 0.6e-3,
        };
        let links = [1.0, 0.5, 0.3, 0.1, 0.1, 0.05].map(link);
        let gravity = Vector3::new(9.81, 0.0, 0.0);
        let arm = Arm::new(ArmSettings { links, x_6_g: Isometry3::identity(), gravity });
        let resistance = Resistance { coulomb, viscous: 0.005, range: [-1.5, 1.5] };
        Plant::new(arm, [resistance; 6], Joints::from([0.1, -0.05, 0.02, 0.0, 0.03, -0.02]))
    }

    #[test]
    fn dry_friction_holds_what_is_too_weak_to_move_it() {
        let mut held = plant(2.0);
        let before = *held.q();
        held.advance(1.0, &Joints::zeros(), None);
        assert!((held.q() - before).norm() < 1e-6, "{}", held.q() - before);
        let mut free = plant(0.0);
        free.advance(0.2, &Joints::zeros(), None);
        assert!((free.q() - before).norm() > 0.01);
    }

    #[test]
    fn a_firm_hand_brings_a_light_wrist_to_rest_where_it_wants_it() {
        let mut plant = plant(0.001);
        let mut x_0_d = *plant.x_0_g();
        x_0_d.translation.vector.y += 0.02;
        plant.advance(3.0, &Joints::zeros(), Some((&Hand::default(), &x_0_d)));
        assert!(plant.qd().norm() < 1e-2, "{}", plant.qd());
        let away = x_0_d.translation.vector - plant.x_0_g().translation.vector;
        assert!(away.norm() < 0.01, "{away}");
    }

    #[test]
    fn an_end_stop_holds_what_the_motor_can_exert() {
        let mut plant = plant(0.01);
        plant.advance(2.0, &Joints::from([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), None);
        assert!(plant.q()[5] < 1.52 && plant.q()[5] > 1.4, "{}", plant.q()[5]);
    }

    #[test]
    fn the_length_of_a_call_does_not_matter_but_for_rounding() {
        let (mut once, mut often) = (plant(0.01), plant(0.01));
        let tau = Joints::from([0.2, 0.1, -0.1, 0.0, 0.05, 0.0]);
        once.advance(0.1, &tau, None);
        (0..100).for_each(|_| often.advance(1e-3, &tau, None));
        assert!((once.q() - often.q()).norm() < 1e-6);
    }
}
