//! Booking: the part of the reflection port in the torques that the drives really hold.
//!
//! The port asks for a torque; [`Slew`](crate::limits::Slew), the gate of the node and a dropped frame decide how much
//! of it a drive holds. Each joint goes some share of the way from its last torque to the one that was asked for, and
//! all parts of its torque go the same share:
//!
//! ```text
//!  w = (τ_held - τ_held_before) / (τ_asked - τ_held_before)      within 0 and 1
//!  p = p_before + w (p_asked - p_before)                         the port's part of τ_held
//! ```
//!
//! The parts always add up to the torque that is held. All torques are those of the actuators, in N·m or N.

use crate::JointVector;

/// Difference of two torques that is rounding, in N·m or N.
const ROUNDING: f64 = 1e-9;

/// Parts of the port: all of it, and its damper alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PortTorques {
    /// Task and damper.
    pub(crate) port: JointVector,
    /// The damper of the passivity controller.
    pub(crate) damper: JointVector,
}

impl PortTorques {
    /// No torques.
    pub(crate) fn zero() -> Self {
        Self { port: JointVector::zeros(), damper: JointVector::zeros() }
    }
}

/// The torques that the drives hold, and the port's parts of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Booking {
    held: JointVector,
    parts: PortTorques,
    asked: JointVector,
    asked_parts: PortTorques,
}

impl Booking {
    /// Starts with no torque.
    pub(crate) fn new() -> Self {
        let none = JointVector::zeros();
        let parts = PortTorques::zero();
        Self { held: none, parts, asked: none, asked_parts: parts }
    }

    /// Keeps the torques that this cycle asks for before they are slewed, and the port's parts of them.
    pub(crate) const fn ask(&mut self, tau: &JointVector, parts: &PortTorques) {
        self.asked = *tau;
        self.asked_parts = *parts;
    }

    /// Books the torques that the drives hold since; returns the port's parts of them. All must be finite.
    pub(crate) fn book(&mut self, held: &JointVector) -> PortTorques {
        let mut way = JointVector::zeros();
        for (way, ((held, before), asked)) in
            way.iter_mut().zip(held.iter().zip(self.held.iter()).zip(self.asked.iter()))
        {
            *way = share_of_way(*before, *asked, *held);
        }
        let PortTorques { port, damper } = self.asked_parts;
        self.parts.port += way.component_mul(&(port - self.parts.port));
        self.parts.damper += way.component_mul(&(damper - self.parts.damper));
        self.held = *held;
        self.parts
    }
}

/// Share of the way from `before` to `asked` that `held` has gone, 0 to 1.
fn share_of_way(before: f64, asked: f64, held: f64) -> f64 {
    let way = asked - before;
    if way.abs() <= ROUNDING { 1.0 } else { ((held - before) / way).clamp(0.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn first(value: f64) -> JointVector {
        JointVector::from([value, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    fn parts(port: f64, damper: f64) -> PortTorques {
        PortTorques { port: first(port), damper: first(damper) }
    }

    /// Asks for a torque with the port's parts of it, of which the drives take `held`.
    fn booked(booking: &mut Booking, asked: [f64; 3], held: f64) -> [f64; 2] {
        let [tau, port, damper] = asked;
        booking.ask(&first(tau), &parts(port, damper));
        let PortTorques { port, damper } = booking.book(&first(held));
        [port[0], damper[0]]
    }

    #[track_caller]
    fn assert_near(found: [f64; 2], expected: [f64; 2]) {
        let differences = found.iter().zip(expected).map(|(found, expected)| found - expected);
        assert!(differences.map(f64::abs).all(|difference| difference < 1e-12), "{found:?}");
    }

    #[test]
    fn torque_that_is_taken_is_booked_as_asked() {
        let mut booking = Booking::new();
        assert_near(booked(&mut booking, [3.0, 2.0, 0.5], 3.0), [2.0, 0.5]);
        assert_near(booked(&mut booking, [3.0, 1.0, -0.5], 3.0), [1.0, -0.5]);
    }

    #[test]
    fn slewed_torque_is_booked_by_its_share_of_the_way() {
        let mut booking = Booking::new();
        assert_near(booked(&mut booking, [4.0, 2.0, 1.0], 1.0), [0.5, 0.25]);
        let [port, damper] = booked(&mut booking, [4.0, 2.0, 1.0], 2.0);
        assert!((port - 1.0).abs() < 1e-12 && (damper - 0.5).abs() < 1e-12);
    }

    #[test]
    fn dropped_target_leaves_the_parts_before() {
        let mut booking = Booking::new();
        booked(&mut booking, [3.0, 2.0, 0.5], 3.0);
        assert_near(booked(&mut booking, [-5.0, -4.0, 0.0], 3.0), [2.0, 0.5]);
    }

    #[test]
    fn torque_that_is_not_permitted_books_nothing() {
        let mut booking = Booking::new();
        assert_near(booked(&mut booking, [3.0, 2.0, 0.5], 0.0), [0.0, 0.0]);
    }

    proptest! {
        #[test]
        fn parts_always_add_up_to_what_is_held(
            steps in prop::collection::vec((-5.0..5.0_f64, 0.0..1.0_f64), 1..50)
        ) {
            // The port is the whole torque: whatever the drives take is the port's.
            let (mut booking, mut held) = (Booking::new(), 0.0_f64);
            for (asked, share) in steps {
                held += share * (asked - held);
                let [port, _] = booked(&mut booking, [asked, asked, 0.0], held);
                prop_assert!((port - held).abs() < 1e-6, "{port} of {held} N·m");
            }
        }
    }
}
