//! How the motor comes to a standstill, whatever the mode: on a halt, a quick stop, a shutdown, a fault
//! (605Ah to 605Eh).
//!
//! Modes that have a velocity slow it down. Torque modes have none to slow down: they take their torque
//! away, on the slope of 6087h in profile torque mode, at once in the cyclic one, where a hand may hold
//! the other end and whoever stops wants it to feel nothing more.

use crate::canopen::object::Object;
use crate::sim::motion::Ramp;
use crate::sim::motion::axis::Axis;
use crate::sim::motion::axis::Moment;
use crate::sim::motion::limits::Limited;
use crate::sim::motion::limits::deceleration;
use crate::sim::motion::ramp::Demand;
use crate::sim::motion::ramp::Profile;
use crate::sim::motion::reached::Standstill;
use crate::sim::motion::torque;

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
    /// Since the ramp has ended, in s.
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

    /// On another ramp from now on, unless it is over.
    pub(super) const fn take(&mut self, ramp: Ramp) {
        self.ramp = ramp;
    }

    /// The motor stands still, or has been given up.
    pub(super) const fn is_over(&self) -> bool {
        self.is_over
    }

    /// The torque for now. Once it is over: none in torque modes, and in others what keeps the place.
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
            Ramp::CurrentLimit => axis.hardest(moment).max(SLOWEST),
        };
        let profile = Profile::new(f64::MAX, rate, rate);
        axis.demand = axis.demand.toward_velocity(moment.dt, 0.0, &profile);
        let asked = axis.follow_velocity(0.0, moment);
        let is_at_rest = self.standstill.is_at_rest(axis, moment);
        if axis.demand.velocity.abs() > 0.0 {
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

/// A brake that no torque is left for is given up, in increments/s²: any speed has gone within
/// milliseconds.
const SLOWEST: f64 = 1e9;
