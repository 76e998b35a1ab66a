//! Play between a motor and its joint: the encoder sees the motor, the joint may move without it.
//!
//! The motor is where the flanks of the gap leave it, a play operator with inertia. Between the flanks its
//! rotor moves by its own torque and nothing reaches the joint; on a flank it goes with the joint, and what
//! pushes the joint reaches it:
//!
//! ```text
//!  J dmd/dt = tau,   |m - q| <= width / 2        tau_joint = tau on the flank it pushes, else 0
//! ```
//!
//! A rotor meets a flank without bouncing. The arm's inertia has the rotor in it all the time, the gap
//! being crossed in milliseconds, so whatever happens here takes energy and gives none.

/// The gap of one joint, and the motor in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Backlash {
    /// Half the width of the gap, at the joint, in rad (m).
    half: f64,
    /// Of the rotor, seen at the joint, in kg·m² (kg).
    rotor_inertia: f64,
    position: f64,
    velocity: f64,
    /// 1 where the motor is ahead of the joint and touches it, -1 where it is behind, 0 between.
    flank: f64,
}

impl Backlash {
    /// A gap of `width` in rad (m) at the joint, and a rotor of this inertia there in kg·m² (kg).
    pub(super) const fn new(width: f64, rotor_inertia: f64) -> Self {
        let half = width.abs() / 2.0;
        Self { half, rotor_inertia, position: 0.0, velocity: 0.0, flank: 0.0 }
    }

    /// Of the motor, as its joint would have to be for it, in rad (m).
    pub(super) const fn position(&self) -> f64 {
        self.position
    }

    /// The same, in rad/s (m/s).
    pub(super) const fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The motor turns with `tau` in N·m (N) for `h` s; what of it reaches the joint.
    pub(super) fn transmit(&mut self, h: f64, tau: f64) -> f64 {
        if self.half <= 0.0 {
            return tau;
        }
        self.velocity += h * tau / self.rotor_inertia;
        self.position += h * self.velocity;
        if self.flank * tau > 0.0 { tau } else { 0.0 }
    }

    /// The joint has moved to `q` with `qd`, in rad and rad/s (m and m/s).
    pub(super) fn follow(&mut self, q: f64, qd: f64) {
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

    /// A joint of `INERTIA`, rotor and all, moved through the gap for so many steps.
    struct Geared {
        backlash: Backlash,
        q: f64,
        qd: f64,
    }

    const INERTIA: f64 = 0.05;

    impl Geared {
        fn new(width: f64) -> Self {
            let mut backlash = Backlash::new(width, ROTOR);
            backlash.follow(0.0, 0.0);
            Self { backlash, q: 0.0, qd: 0.0 }
        }

        fn step(&mut self, tau: f64) -> f64 {
            let given = self.backlash.transmit(H, tau);
            self.qd += H * given / INERTIA;
            self.q += H * self.qd;
            self.backlash.follow(self.q, self.qd);
            given
        }
    }

    proptest! {
        #[test]
        fn the_motor_never_leaves_the_gap(tau in prop::collection::vec(-3.0..3.0_f64, 1..200)) {
            let mut geared = Geared::new(WIDTH);
            for tau in tau {
                geared.step(tau);
                prop_assert!((geared.backlash.position - geared.q).abs() <= WIDTH / 2.0 + 1e-12);
            }
        }

        #[test]
        fn no_energy_comes_out_of_the_gap(tau in prop::collection::vec(-3.0..3.0_f64, 1..200)) {
            let mut geared = Geared::new(WIDTH);
            let (mut work, mut slack) = (0.0, 0.0);
            for tau in tau {
                let before = (geared.backlash.position, geared.q);
                let given = geared.step(tau);
                work += tau * (geared.backlash.position - before.0);
                // What a semi-implicit step gives too much, and a rotor that is still within the gap.
                slack += H * H * (given * given / INERTIA + tau * tau / ROTOR);
                let kinetic = INERTIA * geared.qd * geared.qd / 2.0;
                prop_assert!(kinetic <= work + slack + 3.0 * WIDTH, "{kinetic} J of {work} J");
            }
        }

        #[test]
        fn without_a_gap_motor_and_joint_are_one(q in -3.0..3.0_f64, qd in -9.0..9.0_f64, tau in -3.0..3.0_f64) {
            let mut backlash = Backlash::new(0.0, ROTOR);
            prop_assert_eq!(backlash.transmit(H, tau), tau);
            backlash.follow(q, qd);
            prop_assert_eq!((backlash.position, backlash.velocity), (q, qd));
        }
    }

    #[test]
    fn a_torque_that_turns_round_crosses_the_gap_first() {
        let mut geared = Geared::new(WIDTH);
        // From the middle to a flank, then pushing the joint, which then stands.
        while geared.step(1.0) == 0.0 {}
        (geared.qd, geared.backlash.velocity) = (0.0, 0.0);
        let held = geared.q;
        let mut free = 0.0;
        while geared.step(-1.0) == 0.0 {
            free += H;
            assert_eq!(geared.q, held, "the joint moves although nothing pushes it");
        }
        // width = tau t² / (2 J)
        let expected = (2.0 * WIDTH * ROTOR / 1.0).sqrt();
        assert!((free - expected).abs() <= 2.0 * H, "{free} s, not {expected} s");
    }

    #[test]
    fn a_joint_that_is_moved_to_and_fro_within_the_gap_does_not_take_its_motor_along() {
        let mut backlash = Backlash::new(WIDTH, ROTOR);
        backlash.follow(0.0, 0.0);
        for step in 0..1_000 {
            let phase = f64::from(step) * 0.01;
            backlash.transmit(H, 0.0);
            backlash.follow(0.49 * WIDTH * phase.sin(), 0.49 * WIDTH * phase.cos());
            assert_eq!(backlash.position, 0.0);
        }
    }
}
