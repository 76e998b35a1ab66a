//! Booking: attributes to the reflection port its part of the torques that the drives hold.
//!
//! A drive may hold less than the requested torque, because of [`Slew`](crate::limits::Slew), the node's target limiter
//! or a dropped frame. Each actuator then covers a fraction `w` of the requested change, and so does each part of its
//! torque:
//!
//! ```text
//!  w = (τ_held - τ_held_before) / (τ_requested - τ_held_before)      within 0 and 1
//!  p = p_before + w (p_requested - p_before)                         the port's part of τ_held
//! ```
//!
//! The parts add up to the held torque. All torques are at the actuators, in N·m or N.

use crate::JointVector;

/// Maximum difference of two torques that counts as rounding, in N·m or N.
const ROUNDING: f64 = 1e-9;

/// Actuator torques of the port, in N·m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PortTorques {
    /// Task and passivity damper together.
    pub(crate) port: JointVector,
    /// Passivity damper alone.
    pub(crate) damper: JointVector,
}

impl PortTorques {
    pub(crate) fn zero() -> Self {
        Self { port: JointVector::zeros(), damper: JointVector::zeros() }
    }
}

/// Held and requested torques, and the port's part of each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Booking {
    held: JointVector,
    parts: PortTorques,
    requested: JointVector,
    requested_parts: PortTorques,
}

impl Booking {
    /// Creates a booking with all torques zero.
    pub(crate) fn new() -> Self {
        let none = JointVector::zeros();
        let parts = PortTorques::zero();
        Self { held: none, parts, requested: none, requested_parts: parts }
    }

    /// Records the torques requested in this cycle, before their slew limit, and the port's part of them.
    pub(crate) const fn request(&mut self, tau: &JointVector, parts: &PortTorques) {
        self.requested = *tau;
        self.requested_parts = *parts;
    }

    /// Records the torques that the drives hold since the last request, which must be finite. Returns the port's part.
    pub(crate) fn book(&mut self, held: &JointVector) -> PortTorques {
        let mut fraction = JointVector::zeros();
        for (fraction, ((held, before), requested)) in
            fraction.iter_mut().zip(held.iter().zip(self.held.iter()).zip(self.requested.iter()))
        {
            *fraction = applied_fraction(*before, *requested, *held);
        }
        let PortTorques { port, damper } = self.requested_parts;
        self.parts.port += fraction.component_mul(&(port - self.parts.port));
        self.parts.damper += fraction.component_mul(&(damper - self.parts.damper));
        self.held = *held;
        self.parts
    }
}

/// Returns the applied fraction of the change from `before` to `requested`, 0 to 1.
fn applied_fraction(before: f64, requested: f64, held: f64) -> f64 {
    let change = requested - before;
    if change.abs() <= ROUNDING { 1.0 } else { ((held - before) / change).clamp(0.0, 1.0) }
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

    /// Requests a torque and its port parts while the drives hold `held`; returns the booked parts.
    fn booked(booking: &mut Booking, requested: [f64; 3], held: f64) -> [f64; 2] {
        let [tau, port, damper] = requested;
        booking.request(&first(tau), &parts(port, damper));
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
            // The port requests all of the torque, so all that the drives hold is its part.
            let (mut booking, mut held) = (Booking::new(), 0.0_f64);
            for (asked, share) in steps {
                held += share * (asked - held);
                let [port, _] = booked(&mut booking, [asked, asked, 0.0], held);
                prop_assert!((port - held).abs() < 1e-6, "{port} of {held} N·m");
            }
        }
    }
}
