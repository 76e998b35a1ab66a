//! State shared by all modes: shaft position, demand, and the servo loops.

use crate::motion::limits::{LimitedValue, TorqueLimits, top_speed};
use crate::motion::ramp::Demand;
use crate::motion::servo::{Reference, Servo};
use crate::motion::shaft::{Actual, Shaft};
use crate::motion::tuning::Tuning;
use crate::motion::units::{Units, saturated, wrapped};
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Output of a mode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueDemand {
    /// Torque demand in ‰ of rated torque, within all limits.
    pub per_mille: f64,
    /// Statusword bits 10, 12 and 13, which depend on the mode.
    pub status: u16,
    /// Internal limit active (statusword bit 11).
    pub is_limited: bool,
    /// Error code (603Fh) of a fault in the mode; 0 for none.
    pub error: u16,
}

/// Shaft, demand and control loops of one drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Axis {
    pub(super) shaft: Shaft,
    pub(super) demand: Demand,
    /// Set once a homing has completed.
    pub(super) is_homed: bool,
    /// Set if homing methods 35 and 37 search the index pulse.
    pub(super) homing_moves: bool,
    servo: Servo,
    /// Last torque demand, in ‰.
    last_torque: LimitedValue,
}

/// Input of one step: elapsed time in s, motor values, and objects.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepInput<'a> {
    pub(super) dt: f64,
    pub(super) actual: Actual,
    pub(super) dictionary: &'a Dictionary,
}

impl Axis {
    pub(super) fn new(tuning: Tuning, units: Units) -> Self {
        Self { servo: Servo::new(tuning), shaft: Shaft::new(units), ..Self::default() }
    }

    /// Starts at the actual motion, without a step in torque.
    pub(super) const fn take_over(&mut self, actual: &Actual) {
        self.servo.take_over(actual);
        let Actual { position, velocity, per_mille, .. } = *actual;
        self.demand = Demand { position, velocity, acceleration: 0.0 };
        self.last_torque = LimitedValue { value: per_mille, is_limited: false };
    }

    /// Returns the last torque demand, in ‰.
    pub(super) const fn torque(&self) -> f64 {
        self.last_torque.value
    }

    /// Sets the torque demand, in ‰, within the limits.
    pub(super) fn set_torque(&mut self, torque: f64, input: &StepInput<'_>) -> LimitedValue {
        self.last_torque = TorqueLimits::from_dictionary(input.dictionary).clamp(torque);
        self.last_torque
    }

    /// Runs the position and velocity loops.
    pub(super) fn follow_position(&mut self, torque: f64, input: &StepInput<'_>) -> LimitedValue {
        self.follow(true, torque, input)
    }

    /// Runs the velocity loop alone; the position demand follows the actual position.
    pub(super) fn follow_velocity(&mut self, torque: f64, input: &StepInput<'_>) -> LimitedValue {
        self.demand.position = input.actual.position;
        self.follow(false, torque, input)
    }

    fn follow(&mut self, has_position: bool, torque: f64, input: &StepInput<'_>) -> LimitedValue {
        let limits = TorqueLimits::from_dictionary(input.dictionary);
        let top_speed = top_speed(&self.shaft.units, input.dictionary);
        let reference = Reference { demand: self.demand, has_position, torque, top_speed };
        self.last_torque = if input.dt > 0.0 {
            self.servo.torque(input.dt, &reference, &input.actual, &limits)
        } else {
            let last = limits.clamp(self.last_torque.value);
            LimitedValue { is_limited: last.is_limited || self.last_torque.is_limited, ..last }
        };
        self.last_torque
    }

    /// Returns the maximum deceleration at the torque limit, in increments/s².
    pub(super) fn max_deceleration(&self, input: &StepInput<'_>) -> f64 {
        let limits = TorqueLimits::from_dictionary(input.dictionary);
        let against = if self.demand.velocity > 0.0 { f64::MIN } else { f64::MAX };
        self.servo.acceleration(limits.clamp(against).value.abs())
    }

    /// Returns the following error, in position units.
    pub(super) fn following_error(&self, input: &StepInput<'_>) -> f64 {
        self.shaft.units.position_units(self.demand.position - input.actual.position)
    }

    /// Writes the position demand (6062h, 60FCh) and the following error (60F4h).
    pub(super) fn show_position(&self, actual: &Actual, dictionary: &mut Dictionary) {
        let following_error =
            self.shaft.units.position_units(self.demand.position - actual.position);
        for (object, value) in [
            (Object::POSITION_DEMAND, self.shaft.position_units(self.demand.position)),
            (Object::POSITION_DEMAND_INTERNAL, wrapped(self.demand.position)),
            (Object::FOLLOWING_ERROR, saturated(following_error)),
        ] {
            dictionary.set(object, &value.to_le_bytes());
        }
    }

    /// Writes the velocity demand (606Bh).
    pub(super) fn show_velocity(&self, dictionary: &mut Dictionary) {
        let velocity = saturated(self.shaft.units.velocity_units(self.demand.velocity));
        dictionary.set(Object::VELOCITY_DEMAND, &velocity.to_le_bytes());
    }
}
