//! How the motor comes to a standstill, whatever the mode: on a halt, a quick stop, a shutdown, a fault
//! (605Ah to 605Eh).
//!
//! Modes that have a velocity slow it down. Torque modes have none to slow down: they take their torque
//! away, on the slope of 6087h in profile torque mode, at once in the cyclic one, where a hand may hold
//! the other end and whoever stops wants it to feel nothing more.

use crate::motion::Ramp;
use crate::motion::axis::Axis;
use crate::motion::axis::Moment;
use crate::motion::limits::Limited;
use crate::motion::limits::deceleration;
use crate::motion::ramp::Demand;
use crate::motion::ramp::Profile;
use crate::motion::reached::Standstill;
use crate::motion::torque;
use canopen::object::Object;

/// What a mode leaves to be brought down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stopped {
    Velocity,
    /// Torque, on its slope.
    Torque,
    /// Torque, at once.
    CyclicTorque,
}

/// A stop, under way or over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    ramp: Ramp,
    what: Stopped,
    /// Since the ramp has ended, in s; without one, since the beginning.
    overtime: f64,
    standstill: Standstill,
    is_over: bool,
}

/// How long after its ramp a motor may be in coming to rest, in s: what holds it up then will go on to.
pub(super) const OVERTIME: f64 = 2.0;

impl Stop {
    pub(super) fn new(ramp: Ramp, what: Stopped) -> Self {
        Self { ramp, what, overtime: 0.0, standstill: Standstill::default(), is_over: false }
    }

    /// On this ramp from now on.
    pub(super) const fn take(&mut self, ramp: Ramp) {
        self.ramp = ramp;
    }

    /// The motor stands still, or has been given up.
    pub(super) const fn is_over(&self) -> bool {
        self.is_over
    }

    /// The torque for now; once it is over, none in torque modes, and in others what keeps the place.
    pub(super) fn step(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Limited {
        match (self.is_over, self.what) {
            (true, Stopped::Velocity) => axis.follow_place(0.0, moment),
            (true, Stopped::Torque) | (_, Stopped::CyclicTorque) => {
                self.is_over = true;
                axis.push(0.0, moment)
            }
            (false, Stopped::Torque) => self.lower_torque(axis, moment),
            (false, Stopped::Velocity) => self.slow_down(axis, moment),
        }
    }

    fn lower_torque(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Limited {
        let lower = match self.ramp {
            Ramp::SlowDown | Ramp::QuickStop => torque::toward(axis.torque(), 0.0, moment),
            Ramp::CurrentLimit => 0.0,
        };
        let asked = axis.push(lower, moment);
        self.is_over = asked.value.abs() <= 0.0;
        asked
    }

    fn slow_down(&mut self, axis: &mut Axis, moment: &Moment<'_>) -> Limited {
        let units = &axis.shaft.units;
        let rate = match self.ramp {
            Ramp::SlowDown => deceleration(units, moment.dictionary, Object::PROFILE_DECELERATION),
            Ramp::QuickStop => {
                deceleration(units, moment.dictionary, Object::QUICK_STOP_DECELERATION)
            }
            Ramp::CurrentLimit => axis.hardest(moment),
        };
        let profile = Profile::new(f64::MAX, rate, rate);
        axis.demand = axis.demand.toward_velocity(moment.dt, 0.0, &profile);
        let asked = axis.follow_velocity(0.0, moment);
        let is_at_rest = self.standstill.is_at_rest(axis, moment);
        let is_on_ramp = axis.demand.velocity.abs() > 0.0 && self.ramp != Ramp::CurrentLimit;
        if is_on_ramp {
            return asked;
        }
        self.overtime += moment.dt;
        if is_at_rest || self.overtime >= OVERTIME {
            self.is_over = true;
            axis.demand = Demand::at(moment.actual.place);
        }
        asked
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use super::*;
    use crate::motion::SERVO_PERIOD;
    use crate::motion::fixture::Fixture;
    use crate::motion::fixture::put;
    use crate::motion::rotor::Rotor;

    /// At 100,000 increments/s in profile velocity mode.
    fn moving() -> Fixture {
        let moving = Rotor { velocity: 100_000.0, coulomb: 30.0, ..Rotor::default() };
        let mut fixture = Fixture::with(3, moving, |dictionary| {
            put(dictionary, Object::TARGET_VELOCITY, 100_000);
        });
        fixture.run(300);
        fixture
    }

    /// How many ms a stop takes, and the most torque that is asked for on its way.
    fn stop(fixture: &mut Fixture, ramp: Ramp) -> (u32, f64) {
        let mut most = 0.0_f64;
        for millis in 0..10_000 {
            let Some(asked) = fixture.brake(ramp) else { return (millis, most) };
            most = most.max(asked.per_mille.abs());
        }
        panic!("no end");
    }

    #[test]
    fn each_ramp_takes_its_time() {
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
    fn all_the_torque_there_is_is_the_limit_and_no_more() {
        let mut fixture = moving();
        fixture.put(Object::NEGATIVE_TORQUE_LIMIT, 700);
        let (_, most) = stop(&mut fixture, Ramp::CurrentLimit);
        assert_eq!(most, 700.0);
    }

    #[test]
    fn a_motor_that_cannot_be_stopped_is_given_up() {
        for ramp in [Ramp::SlowDown, Ramp::QuickStop, Ramp::CurrentLimit] {
            let mut fixture = moving();
            fixture.put(Object::MAX_TORQUE, 0);
            fixture.rotor.coulomb = 0.0;
            let (taken, _) = stop(&mut fixture, ramp);
            let bound = OVERTIME + 0.1;
            assert!(f64::from(taken) * SERVO_PERIOD <= bound + 0.01, "{ramp:?}: {taken} ms");
        }
    }

    #[test]
    fn what_has_stopped_stays_where_it_is() {
        let mut fixture = moving();
        stop(&mut fixture, Ramp::QuickStop);
        let place = fixture.rotor.place;
        fixture.rotor.load = 300.0;
        for _ in 0..2_000 {
            let asked = fixture.motion.hold(
                SERVO_PERIOD,
                &fixture.rotor.feedback(),
                &mut fixture.dictionary,
            );
            fixture.rotor.turn(SERVO_PERIOD, asked.per_mille);
        }
        assert!((fixture.rotor.place - place).abs() < 100.0);
        assert!(fixture.brake(Ramp::QuickStop).is_none(), "it is over for good");
    }

    #[test]
    fn a_torque_has_nothing_to_slow_down() {
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
            assert_eq!(fixture.asked.per_mille, 500.0);
            let (taken, most) = stop(&mut fixture, ramp);
            assert_eq!(taken, expected, "{mode}, {ramp:?}");
            assert!(most < 500.0);
        }
    }
}
