//! Backlash between motor and joint: the encoder is on the motor side.
//!
//! A play operator with inertia. Inside the gap the motor torque accelerates the rotor only, and the joint moves
//! without it. At a flank both move together, and torque is transmitted:
//!
//! ```text
//!  J dmd/dt = tau,   |m - q| <= width / 2        tau_joint = tau at the flank it pushes, else 0
//! ```
//!
//! The rotor meets a flank without rebound. Its inertia is part of the arm's at all times, since the gap is crossed in
//! milliseconds: backlash dissipates energy and never adds any.

/// Backlash of one joint, with its motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Backlash {
    /// Half the width of the gap, at the joint, in rad (m).
    half: f64,
    /// Rotor inertia at the joint, in kg·m² (kg).
    rotor_inertia: f64,
    position: f64,
    velocity: f64,
    /// Flank in contact: 1 with the motor ahead of the joint, -1 behind, 0 for none.
    flank: f64,
}

impl Backlash {
    /// Creates a gap of `width` in rad (m) and a rotor inertia in kg·m² (kg), both at the joint.
    pub(super) const fn new(width: f64, rotor_inertia: f64) -> Self {
        let half = width.abs() / 2.0;
        Self { half, rotor_inertia, position: 0.0, velocity: 0.0, flank: 0.0 }
    }

    /// Returns the motor position in joint coordinates, in rad (m).
    pub(super) const fn position(&self) -> f64 {
        self.position
    }

    /// Returns the motor velocity in joint coordinates, in rad/s (m/s).
    pub(super) const fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Applies `tau` in N·m (N) to the motor for `h` s and returns the torque transmitted to the joint.
    pub(super) fn transmit(&mut self, h: f64, tau: f64) -> f64 {
        if self.half <= 0.0 {
            return tau;
        }
        self.velocity += h * tau / self.rotor_inertia;
        self.position += h * self.velocity;
        if self.flank * tau > 0.0 { tau } else { 0.0 }
    }

    /// Sets joint position and velocity, in rad and rad/s (m and m/s).
    pub(super) fn set_joint_motion(&mut self, q: f64, qd: f64) {
        let ahead = self.position - q;
        if ahead.abs() < self.half {
            self.flank = 0.0;
        } else {
            self.flank = ahead.signum();
            self.position = q + ahead.clamp(-self.half, self.half);
            self.velocity = qd;
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "what is not touched stays what it is, bit for bit")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const WIDTH: f64 = 0.01;
    const H: f64 = 250e-6;
    const ROTOR: f64 = 0.008;

    /// Joint of `INERTIA`, including the rotor, with backlash.
    struct GearedJoint {
        backlash: Backlash,
        q: f64,
        qd: f64,
    }

    const INERTIA: f64 = 0.05;

    impl GearedJoint {
        fn new(width: f64) -> Self {
            let mut backlash = Backlash::new(width, ROTOR);
            backlash.set_joint_motion(0.0, 0.0);
            Self { backlash, q: 0.0, qd: 0.0 }
        }

        fn step(&mut self, tau: f64) -> f64 {
            let transmitted = self.backlash.transmit(H, tau);
            self.qd += H * transmitted / INERTIA;
            self.q += H * self.qd;
            self.backlash.set_joint_motion(self.q, self.qd);
            transmitted
        }
    }

    proptest! {
        #[test]
        fn motor_stays_within_the_gap(tau in prop::collection::vec(-3.0..3.0_f64, 1..200)) {
            let mut geared = GearedJoint::new(WIDTH);
            for tau in tau {
                geared.step(tau);
                prop_assert!((geared.backlash.position - geared.q).abs() <= WIDTH / 2.0 + 1e-12);
            }
        }

        #[test]
        fn backlash_adds_no_energy(tau in prop::collection::vec(-3.0..3.0_f64, 1..200)) {
            let mut geared = GearedJoint::new(WIDTH);
            let (mut work, mut slack) = (0.0, 0.0);
            for tau in tau {
                let before = (geared.backlash.position, geared.q);
                let transmitted = geared.step(tau);
                work += tau * (geared.backlash.position - before.0);
                // Error of the semi-implicit step, and the rotor inside the gap.
                slack += H * H * (transmitted * transmitted / INERTIA + tau * tau / ROTOR);
                let kinetic = INERTIA * geared.qd * geared.qd / 2.0;
                prop_assert!(kinetic <= work + slack + 3.0 * WIDTH, "{kinetic} J of {work} J");
            }
        }

        #[test]
        fn zero_backlash_transmits_everything(q in -3.0..3.0_f64, qd in -9.0..9.0_f64, tau in -3.0..3.0_f64) {
            let mut backlash = Backlash::new(0.0, ROTOR);
            prop_assert_eq!(backlash.transmit(H, tau), tau);
            backlash.set_joint_motion(q, qd);
            prop_assert_eq!((backlash.position, backlash.velocity), (q, qd));
        }
    }

    #[test]
    fn torque_reversal_crosses_the_gap_first() {
        let mut geared = GearedJoint::new(WIDTH);
        // From the middle to a flank; then the joint is stopped.
        while geared.step(1.0) == 0.0 {}
        (geared.qd, geared.backlash.velocity) = (0.0, 0.0);
        let held = geared.q;
        let mut free = 0.0;
        while geared.step(-1.0) == 0.0 {
            free += H;
            assert_eq!(geared.q, held, "the joint moves without torque");
        }
        // width = tau t² / (2 J)
        let expected = (2.0 * WIDTH * ROTOR / 1.0).sqrt();
        assert!((free - expected).abs() <= 2.0 * H, "{free} s, not {expected} s");
    }

    #[test]
    fn joint_motion_within_the_gap_does_not_move_the_motor() {
        let mut backlash = Backlash::new(WIDTH, ROTOR);
        backlash.set_joint_motion(0.0, 0.0);
        for step in 0..1_000 {
            let phase = f64::from(step) * 0.01;
            backlash.transmit(H, 0.0);
            backlash.set_joint_motion(0.49 * WIDTH * phase.sin(), 0.49 * WIDTH * phase.cos());
            assert_eq!(backlash.position, 0.0);
        }
    }
}
