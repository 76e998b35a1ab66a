//! The servo: a position loop around a velocity loop around the current loop (Ellis, Control System
//! Design Guide, ch. 17: P/PI with feed-forward).
//!
//! The gains come from the inertia the motor has to move, so that one set of bandwidths does for every
//! joint. They hold with the inertia three times off either way, 1 ms servo period and 2 ms of delay.

use std::f64::consts::TAU;

use crate::motion::limits::Limited;
use crate::motion::limits::TorqueLimits;
use crate::motion::limits::within;
use crate::motion::ramp::Demand;
use crate::motion::shaft::Actual;
use crate::motion::tuning::Tuning;

/// Bandwidth of the velocity loop, in rad/s.
const VELOCITY_BANDWIDTH: f64 = TAU * 20.0;
/// Where its integrator takes over, in rad/s.
const INTEGRATOR_CORNER: f64 = TAU * 2.5;
/// Bandwidth of the position loop, in rad/s.
const POSITION_BANDWIDTH: f64 = TAU * 4.0;

/// What the loops aim at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aim {
    pub(super) demand: Demand,
    /// Whether the place counts, or the velocity alone.
    pub(super) has_place: bool,
    /// Torque that is known to be needed, in ‰.
    pub(super) torque: f64,
    /// The motor is not asked to turn faster, in increments/s.
    pub(super) top_speed: f64,
}

/// Both loops.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Servo {
    tuning: Tuning,
    /// Of the velocity loop, in ‰.
    integral: f64,
}

impl Servo {
    pub(super) const fn new(tuning: Tuning) -> Self {
        Self { tuning, integral: 0.0 }
    }

    /// Takes over from whatever has made the torque until now, without a jump.
    pub(super) const fn take_over(&mut self, actual: &Actual) {
        self.integral = actual.per_mille;
    }

    /// What a torque in ‰ accelerates the motor by, in increments/s².
    pub(super) fn acceleration(&self, torque: f64) -> f64 {
        torque / self.tuning.inertia
    }

    /// The torque for the next `dt` s, in ‰.
    pub(super) fn torque(
        &mut self,
        dt: f64,
        aim: &Aim,
        actual: &Actual,
        limits: &TorqueLimits,
    ) -> Limited {
        let demand = &aim.demand;
        let behind = if aim.has_place { demand.place - actual.place } else { 0.0 };
        let wanted = demand.velocity + POSITION_BANDWIDTH * behind;
        let slower = within(wanted, aim.top_speed).value - actual.velocity;
        let gain = self.tuning.inertia * VELOCITY_BANDWIDTH;
        let forward = self.tuning.inertia * demand.acceleration
            + self.tuning.viscous * demand.velocity
            + aim.torque;
        let grown = self.integral + gain * INTEGRATOR_CORNER * slower * dt;
        let asked = limits.clamp(forward + gain * slower + grown);
        // Anti-windup: at a limit the integrator only leaves it.
        let is_winding_up = asked.is_limited && (grown - self.integral) * asked.value > 0.0;
        let integral = if is_winding_up { self.integral } else { grown };
        self.integral = limits.clamp(integral).value;
        asked
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use super::*;
    use crate::motion::SERVO_PERIOD;
    use crate::motion::fixture::drive;
    use crate::motion::limits::top_speed;
    use crate::motion::ramp::Course;
    use crate::motion::ramp::Profile;
    use crate::motion::rotor::Rotor;
    use crate::motion::units::Units;

    const TOP: f64 = 1.6e6;

    fn aim(demand: Demand) -> Aim {
        Aim { demand, has_place: true, torque: 0.0, top_speed: TOP }
    }

    fn limits() -> TorqueLimits {
        TorqueLimits::of(&drive())
    }

    /// A rotor whose inertia is `ratio` of what the servo was tuned for.
    fn rotor(ratio: f64) -> Rotor {
        let tuning = Tuning::default();
        Rotor { inertia: tuning.inertia * ratio, ..Rotor::default() }
    }

    /// Follows `demands` and says how far it is behind at each.
    fn follow(rotor: &mut Rotor, demands: impl Iterator<Item = Demand>) -> Vec<f64> {
        let mut servo = Servo::new(Tuning::default());
        let limits = limits();
        let mut behind = Vec::new();
        for demand in demands {
            let actual = rotor.actual();
            behind.push(demand.place - actual.place);
            let asked = servo.torque(SERVO_PERIOD, &aim(demand), &actual, &limits);
            rotor.turn(SERVO_PERIOD, asked.value);
        }
        behind
    }

    #[test]
    fn the_factory_speed_limit_is_the_one_of_these_tests() {
        assert_eq!(top_speed(&Units::of(&drive()), &drive()), TOP);
    }

    #[test]
    fn a_load_that_comes_at_once_is_held_and_the_place_kept() {
        for ratio in [1.0 / 3.0, 1.0, 3.0] {
            let mut rotor = Rotor { load: 500.0, coulomb: 30.0, ..rotor(ratio) };
            let behind = follow(&mut rotor, std::iter::repeat_n(Demand::at(0.0), 3_000));
            let end = behind[2_700..].iter().fold(0.0, |most: f64, way| most.max(way.abs()));
            assert!(end < 30.0, "{ratio}: {end} increments off after 3 s");
            assert!(rotor.velocity.abs() < 200.0, "{ratio}: {} increments/s", rotor.velocity);
        }
    }

    #[test]
    fn a_profile_is_tracked_whatever_the_arm_weighs_just_then() {
        let course = Course::to_place(Demand::at(0.0), 2e5, &Profile::new(1e5, 1e6, 1e6));
        for (ratio, allowed) in [(1.0 / 3.0, 1_500.0), (1.0, 1_500.0), (3.0, 1_500.0)] {
            let mut rotor = Rotor { coulomb: 30.0, ..rotor(ratio) };
            let demands = (0..3_500).map(|tick| course.at(f64::from(tick) * SERVO_PERIOD));
            let behind = follow(&mut rotor, demands);
            let most = behind.iter().fold(0.0, |most: f64, way| most.max(way.abs()));
            assert!(most < allowed, "{ratio}: {most} increments behind");
            assert!(behind[3_400].abs() < 100.0, "{ratio}: {} in the end", behind[3_400]);
        }
    }

    #[test]
    fn what_was_stopped_by_force_comes_back_without_winding_up() {
        let mut rotor = rotor(1.0);
        let mut servo = Servo::new(Tuning::default());
        let (aim, limits) = (aim(Demand::at(20_000.0)), limits());
        let mut past = 0.0_f64;
        for tick in 0..4_000 {
            let actual = rotor.actual();
            let asked = servo.torque(SERVO_PERIOD, &aim, &actual, &limits);
            if tick >= 2_000 {
                rotor.turn(SERVO_PERIOD, asked.value);
                past = past.max(actual.place - 20_000.0);
            }
        }
        assert!((rotor.place - 20_000.0).abs() < 100.0);
        assert!(past < 20_000.0, "{past} increments beyond");
    }

    #[test]
    fn it_takes_over_the_torque_there_is() {
        let mut servo = Servo::new(Tuning::default());
        let actual = Actual { per_mille: 321.0, ..Actual::default() };
        servo.take_over(&actual);
        let asked = servo.torque(0.0, &aim(Demand::at(0.0)), &actual, &limits());
        assert_eq!(asked.value, 321.0);
    }
}
