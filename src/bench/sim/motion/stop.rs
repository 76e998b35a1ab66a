//! Stops in all modes: halt, quick stop, shutdown, fault (605Ah to 605Eh).
//!
//! Modes with a velocity decelerate. Torque modes remove their torque: in profile torque mode on the slope of 6087h, in
//! cyclic synchronous torque mode at once. In the latter a hand may hold the load.

use crate::motion::axis::{Axis, StepInput};
use crate::motion::limits::{LimitedValue, deceleration};
use crate::motion::ramp::{Demand, Profile};
use crate::motion::reached::Standstill;
use crate::motion::torque;
use canopen::object::Object;

/// Ramp of a stop (605Ah to 605Eh).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// Slow down ramp, 6084h.
    SlowDown,
    /// Quick stop ramp, 6085h.
    QuickStop,
    /// Maximum torque.
    CurrentLimit,
}

/// Quantity that a stop brings to zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StopQuantity {
    Velocity,
    /// Torque, on its slope (6087h).
    Torque,
    /// Torque, at once.
    CyclicTorque,
}

/// Ramp, quantity and time of a stop in progress or completed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    ramp: Ramp,
    what: StopQuantity,
    /// Time since the end of the ramp, in s; since the start without a ramp.
    overtime: f64,
    standstill: Standstill,
    is_over: bool,
}

/// Time allowed after the ramp to come to a standstill, in s.
pub(super) const STANDSTILL_TIMEOUT: f64 = 2.0;

impl Stop {
    pub(super) fn new(ramp: Ramp, what: StopQuantity) -> Self {
        Self { ramp, what, overtime: 0.0, standstill: Standstill::default(), is_over: false }
    }

    /// Changes the ramp.
    pub(super) const fn set_ramp(&mut self, ramp: Ramp) {
        self.ramp = ramp;
    }

    /// Returns whether the motor is at standstill or the stop has timed out.
    pub(super) const fn is_over(&self) -> bool {
        self.is_over
    }

    /// Returns the torque demand; after the stop zero in torque modes, else that which holds the position.
    pub(super) fn step(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> LimitedValue {
        match (self.is_over, self.what) {
            (true, StopQuantity::Velocity) => axis.follow_position(0.0, input),
            (true, StopQuantity::Torque) | (_, StopQuantity::CyclicTorque) => {
                self.is_over = true;
                axis.set_torque(0.0, input)
            }
            (false, StopQuantity::Torque) => self.lower_torque(axis, input),
            (false, StopQuantity::Velocity) => self.slow_down(axis, input),
        }
    }

    fn lower_torque(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> LimitedValue {
        let lower = match self.ramp {
            Ramp::SlowDown | Ramp::QuickStop => torque::approach(axis.torque(), 0.0, input),
            Ramp::CurrentLimit => 0.0,
        };
        let torque = axis.set_torque(lower, input);
        self.is_over = torque.value.abs() <= 0.0;
        torque
    }

    fn slow_down(&mut self, axis: &mut Axis, input: &StepInput<'_>) -> LimitedValue {
        let units = &axis.shaft.units;
        let rate = match self.ramp {
            Ramp::SlowDown => deceleration(units, input.dictionary, Object::PROFILE_DECELERATION),
            Ramp::QuickStop => {
                deceleration(units, input.dictionary, Object::QUICK_STOP_DECELERATION)
            }
            Ramp::CurrentLimit => axis.max_deceleration(input),
        };
        let profile = Profile::new(f64::MAX, rate, rate);
        axis.demand = axis.demand.toward_velocity(input.dt, 0.0, &profile);
        let torque = axis.follow_velocity(0.0, input);
        let is_at_rest = self.standstill.is_at_rest(axis, input);
        let is_on_ramp = axis.demand.velocity.abs() > 0.0 && self.ramp != Ramp::CurrentLimit;
        if is_on_ramp {
            return torque;
        }
        self.overtime += input.dt;
        if is_at_rest || self.overtime >= STANDSTILL_TIMEOUT {
            self.is_over = true;
            axis.demand = Demand::at(input.actual.position);
        }
        torque
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use super::*;
    use crate::motion::SERVO_PERIOD;
    use crate::motion::fixture::{Fixture, put};
    use crate::motion::rotor::Rotor;

    /// Returns a motor at 100,000 increments/s in profile velocity mode.
    fn moving() -> Fixture {
        let moving = Rotor { velocity: 100_000.0, coulomb: 30.0, ..Rotor::default() };
        let mut fixture = Fixture::with(3, moving, |dictionary| {
            put(dictionary, Object::TARGET_VELOCITY, 100_000);
        });
        fixture.run(300);
        fixture
    }

    /// Returns the duration of a stop in ms, and the maximum torque demand.
    fn stop(fixture: &mut Fixture, ramp: Ramp) -> (u32, f64) {
        let mut most = 0.0_f64;
        for millis in 0..10_000 {
            let Some(demand) = fixture.brake(ramp) else { return (millis, most) };
            most = most.max(demand.per_mille.abs());
        }
        panic!("no end");
    }

    #[test]
    fn stops_take_the_time_of_their_ramp() {
        // 100,000 increments/s at 1,000,000/s² and at 10,000,000/s², and at once.
        for (ramp, least, most) in
            [(Ramp::SlowDown, 100, 400), (Ramp::QuickStop, 10, 300), (Ramp::CurrentLimit, 1, 300)]
        {
            let mut fixture = moving();
            let before = fixture.rotor.velocity;
            assert!((before - 100_000.0).abs() < 1_000.0, "{before}");
            let (taken, _) = stop(&mut fixture, ramp);
            assert!((least..most).contains(&taken), "{ramp:?}: {taken} ms");
            assert!(fixture.rotor.velocity.abs() < 500.0, "{ramp:?}: {}", fixture.rotor.velocity);
        }
    }

    #[test]
    fn current_limit_stop_stays_within_the_torque_limit() {
        let mut fixture = moving();
        fixture.put(Object::NEGATIVE_TORQUE_LIMIT, 700);
        let (_, most) = stop(&mut fixture, Ramp::CurrentLimit);
        assert_eq!(most, 700.0);
    }

    #[test]
    fn stop_without_torque_times_out() {
        for ramp in [Ramp::SlowDown, Ramp::QuickStop, Ramp::CurrentLimit] {
            let mut fixture = moving();
            fixture.put(Object::MAX_TORQUE, 0);
            fixture.rotor.coulomb = 0.0;
            let (taken, _) = stop(&mut fixture, ramp);
            let bound = STANDSTILL_TIMEOUT + 0.1;
            assert!(f64::from(taken) * SERVO_PERIOD <= bound + 0.01, "{ramp:?}: {taken} ms");
        }
    }

    #[test]
    fn stopped_motor_holds_its_position() {
        let mut fixture = moving();
        stop(&mut fixture, Ramp::QuickStop);
        let position = fixture.rotor.position;
        fixture.rotor.load = 300.0;
        for _ in 0..2_000 {
            let demand = fixture.motion.hold(
                SERVO_PERIOD,
                &fixture.rotor.feedback(),
                &mut fixture.dictionary,
            );
            fixture.rotor.step(SERVO_PERIOD, demand.per_mille);
        }
        assert!((fixture.rotor.position - position).abs() < 100.0);
        assert!(fixture.brake(Ramp::QuickStop).is_none(), "the stop stays completed");
    }

    #[test]
    fn torque_modes_remove_the_torque() {
        for (mode, ramp, expected) in [
            (10, Ramp::SlowDown, 0),
            (10, Ramp::QuickStop, 0),
            (10, Ramp::CurrentLimit, 0),
            (4, Ramp::SlowDown, 49),
            (4, Ramp::QuickStop, 49),
            (4, Ramp::CurrentLimit, 0),
        ] {
            let mut fixture = Fixture::new(mode);
            fixture.put(Object::TARGET_TORQUE, 500);
            fixture.run(100);
            assert_eq!(fixture.demand.per_mille, 500.0);
            let (taken, most) = stop(&mut fixture, ramp);
            assert_eq!(taken, expected, "{mode}, {ramp:?}");
            assert!(most < 500.0);
        }
    }
}
