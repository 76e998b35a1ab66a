//! Control loops: position loop around velocity loop around current loop (Ellis, Control System Design Guide, ch. 17:
//! P/PI with feed-forward).
//!
//! The gains scale with the inertia, so all joints have the same bandwidths. The loops are stable with an inertia three
//! times too large or too small, a period of 1 ms and a delay of 2 ms.

use std::f64::consts::TAU;

use crate::motion::limits::{LimitedValue, TorqueLimits, within};
use crate::motion::ramp::Demand;
use crate::motion::shaft::Actual;
use crate::motion::tuning::Tuning;

/// Bandwidth of the velocity loop, in rad/s.
const VELOCITY_BANDWIDTH: f64 = TAU * 20.0;
/// Corner frequency of the velocity loop's integrator, in rad/s.
const INTEGRATOR_CORNER: f64 = TAU * 2.5;
/// Bandwidth of the position loop, in rad/s.
const POSITION_BANDWIDTH: f64 = TAU * 4.0;

/// Set-point of the loops.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reference {
    pub(super) demand: Demand,
    /// Set if the position loop is closed, not the velocity loop alone.
    pub(super) has_position: bool,
    /// Torque feed-forward, in ‰.
    pub(super) torque: f64,
    /// Speed limit, in increments/s.
    pub(super) top_speed: f64,
}

/// Position and velocity loop.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Servo {
    tuning: Tuning,
    /// Integrator of the velocity loop, in ‰.
    integral: f64,
}

impl Servo {
    pub(super) const fn new(tuning: Tuning) -> Self {
        Self { tuning, integral: 0.0 }
    }

    /// Sets the integrator to the actual torque: no step at the start.
    pub(super) const fn take_over(&mut self, actual: &Actual) {
        self.integral = actual.per_mille;
    }

    /// Returns the acceleration caused by a torque in ‰, in increments/s².
    pub(super) fn acceleration(&self, torque: f64) -> f64 {
        torque / self.tuning.inertia
    }

    /// Returns the torque demand for the next `dt` s, in ‰.
    pub(super) fn torque(
        &mut self,
        dt: f64,
        reference: &Reference,
        actual: &Actual,
        limits: &TorqueLimits,
    ) -> LimitedValue {
        let demand = &reference.demand;
        let following_error =
            if reference.has_position { demand.position - actual.position } else { 0.0 };
        let wanted = demand.velocity + POSITION_BANDWIDTH * following_error;
        let velocity_error = within(wanted, reference.top_speed).value - actual.velocity;
        let gain = self.tuning.inertia * VELOCITY_BANDWIDTH;
        let forward = self.tuning.inertia * demand.acceleration
            + self.tuning.viscous * demand.velocity
            + reference.torque;
        let grown = self.integral + gain * INTEGRATOR_CORNER * velocity_error * dt;
        let torque = limits.clamp(forward + gain * velocity_error + grown);
        // Anti-windup: at a limit the integrator may only move away from it.
        let is_winding_up = torque.is_limited && (grown - self.integral) * torque.value > 0.0;
        let integral = if is_winding_up { self.integral } else { grown };
        self.integral = limits.clamp(integral).value;
        torque
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use super::*;
    use crate::motion::SERVO_PERIOD;
    use crate::motion::fixture::{INCREMENTS, drive};
    use crate::motion::limits::top_speed;
    use crate::motion::ramp::{Profile, Trajectory};
    use crate::motion::rotor::Rotor;
    use crate::motion::units::Units;

    const TOP: f64 = 1.6e6;

    fn reference(demand: Demand) -> Reference {
        Reference { demand, has_position: true, torque: 0.0, top_speed: TOP }
    }

    fn limits() -> TorqueLimits {
        TorqueLimits::from_dictionary(&drive())
    }

    /// Returns a rotor whose inertia is `ratio` times the tuned one.
    fn rotor(ratio: f64) -> Rotor {
        let tuning = Tuning::default();
        Rotor { inertia: tuning.inertia * ratio, ..Rotor::default() }
    }

    /// Follows `demands` and returns the following error at each.
    fn follow(rotor: &mut Rotor, demands: impl Iterator<Item = Demand>) -> Vec<f64> {
        let mut servo = Servo::new(Tuning::default());
        let limits = limits();
        let mut behind = Vec::new();
        for demand in demands {
            let actual = rotor.actual();
            behind.push(demand.position - actual.position);
            let torque = servo.torque(SERVO_PERIOD, &reference(demand), &actual, &limits);
            rotor.step(SERVO_PERIOD, torque.value);
        }
        behind
    }

    #[test]
    fn default_speed_limit_is_that_of_these_tests() {
        assert_eq!(top_speed(&Units::from_dictionary(&drive(), INCREMENTS), &drive()), TOP);
    }

    #[test]
    fn position_is_held_against_a_load_step() {
        for ratio in [1.0 / 3.0, 1.0, 3.0] {
            let mut rotor = Rotor { load: 500.0, coulomb: 30.0, ..rotor(ratio) };
            let behind = follow(&mut rotor, std::iter::repeat_n(Demand::at(0.0), 3_000));
            let end =
                behind[2_700..].iter().fold(0.0, |most: f64, distance| most.max(distance.abs()));
            assert!(end < 30.0, "{ratio}: {end} increments off after 3 s");
            assert!(rotor.velocity.abs() < 200.0, "{ratio}: {} increments/s", rotor.velocity);
        }
    }

    #[test]
    fn profile_is_tracked_with_any_inertia() {
        let trajectory =
            Trajectory::to_position(Demand::at(0.0), 2e5, &Profile::new(1e5, 1e6, 1e6));
        for (ratio, allowed) in [(1.0 / 3.0, 1_500.0), (1.0, 1_500.0), (3.0, 1_500.0)] {
            let mut rotor = Rotor { coulomb: 30.0, ..rotor(ratio) };
            let demands = (0..3_500).map(|tick| trajectory.at(f64::from(tick) * SERVO_PERIOD));
            let behind = follow(&mut rotor, demands);
            let most = behind.iter().fold(0.0, |most: f64, distance| most.max(distance.abs()));
            assert!(most < allowed, "{ratio}: {most} increments behind");
            assert!(behind[3_400].abs() < 100.0, "{ratio}: {} in the end", behind[3_400]);
        }
    }

    #[test]
    fn blocked_motor_recovers_without_windup() {
        let mut rotor = rotor(1.0);
        let mut servo = Servo::new(Tuning::default());
        let (reference, limits) = (reference(Demand::at(20_000.0)), limits());
        let mut past = 0.0_f64;
        for tick in 0..4_000 {
            let actual = rotor.actual();
            let torque = servo.torque(SERVO_PERIOD, &reference, &actual, &limits);
            if tick >= 2_000 {
                rotor.step(SERVO_PERIOD, torque.value);
                past = past.max(actual.position - 20_000.0);
            }
        }
        assert!((rotor.position - 20_000.0).abs() < 100.0);
        assert!(past < 20_000.0, "{past} increments beyond");
    }

    #[test]
    fn take_over_keeps_the_actual_torque() {
        let mut servo = Servo::new(Tuning::default());
        let actual = Actual { per_mille: 321.0, ..Actual::default() };
        servo.take_over(&actual);
        let torque = servo.torque(0.0, &reference(Demand::at(0.0)), &actual, &limits());
        assert_eq!(torque.value, 321.0);
    }
}
