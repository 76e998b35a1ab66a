//! Modes of operation and stops of an enabled drive (CiA 402-2, 8 to 15).
//!
//! Input: set-points and feedback. Output: torque demand, and objects such as 6062h. Power state machine and current loop
//! are elsewhere.
//!
//! | files                                           | content                                     |
//! |-------------------------------------------------|---------------------------------------------|
//! | `operation_mode`, `bits`                        | dispatch, and the bits of the modes         |
//! | `profile_position`, `profile_velocity`, `torque`, `homing`, `cyclic` | the modes              |
//! | `stop`                                          | stops                                       |
//! | `axis`                                          | shared state                                |
//! | `ramp`, `limits`                                | profile generators and limits               |
//! | `following`, `reached`, `condition_timer`       | windows in position, velocity and time      |
//! | `servo`, `tuning`                               | control loops, inertia and friction         |
//! | `shaft`, `units`                                | increments, home, factor group              |

mod axis;
mod bits;
mod condition_timer;
mod cyclic;
#[cfg(test)]
mod fixture;
mod following;
mod homing;
mod limits;
mod operation_mode;
mod profile_position;
mod profile_velocity;
mod ramp;
mod reached;
#[cfg(test)]
mod rotor;
mod servo;
mod shaft;
mod stop;
#[cfg(test)]
mod tests;
mod torque;
mod tuning;
mod units;

pub use axis::TorqueDemand;
pub use shaft::Feedback;
pub use stop::Ramp;
pub use tuning::{InvalidLoad, Load, Tuning};
pub(crate) use units::wrapped;

use axis::{Axis, StepInput};
use operation_mode::OperationMode;
use stop::Stop;

use canopen::drive::Controlword;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;
use units::Units;

/// Converts a position (6064h) to counts of an encoder with `increments` per revolution, by the factors of
/// `dictionary`; wraps.
pub(crate) fn encoder_counts(dictionary: &Dictionary, increments: f64, position: i32) -> i32 {
    wrapped(Units::from_dictionary(dictionary, increments).increments(f64::from(position)))
}

/// Period of the position and velocity loops, in s.
pub const SERVO_PERIOD: f64 = 1e-3;

/// Modes of one drive, with their state.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    axis: Axis,
    mode: OperationMode,
    word: Controlword,
    /// Stop in progress or completed; a step in operation ends it.
    stop: Option<Stop>,
    /// Set if the objects still show the previous mode.
    is_fresh: bool,
}

impl Motion {
    /// Creates the state without a mode. The encoder has `increments` per revolution.
    pub fn new(tuning: Tuning, increments: f64, dictionary: &Dictionary) -> Self {
        Self {
            axis: Axis::new(tuning, Units::from_dictionary(dictionary, increments)),
            ..Self::default()
        }
    }

    /// Makes homing methods 35 and 37 search the index pulse, as method 34 does.
    #[must_use]
    pub const fn with_moving_homing(mut self, homing_moves: bool) -> Self {
        self.axis.homing_moves = homing_moves;
        self
    }

    /// Returns whether a homing has completed since the state was created or [`forget_homing`](Self::forget_homing).
    pub const fn is_homed(&self) -> bool {
        self.axis.is_homed
    }

    /// Forgets that a homing has completed. The home position stays.
    pub const fn forget_homing(&mut self) {
        self.axis.is_homed = false;
    }

    /// Updates the factor group after a write of `object`. [`begin`](Self::begin) updates it as well.
    pub fn on_written(&mut self, object: Object, dictionary: &Dictionary) {
        if Units::depend_on(object) {
            self.axis.shaft.units.read(dictionary);
        }
    }

    /// Returns 6064h in position units from home, 32 bits, wraps. Call it at least once per 2³¹ increments, also while
    /// the drive is disabled.
    pub fn position(&mut self, feedback: &Feedback) -> i32 {
        let actual = self.axis.shaft.sense(feedback);
        self.axis.shaft.position_units(actual.position)
    }

    /// Returns 606Ch in position units per second.
    pub fn velocity(&self, feedback: &Feedback) -> i32 {
        units::saturated(self.axis.shaft.units.velocity_units(feedback.velocity))
    }

    /// Starts a mode, after a change of 6060h or when the drive is enabled; the motor holds its position.
    pub fn begin(&mut self, mode: i8, feedback: &Feedback, dictionary: &Dictionary) {
        self.axis.shaft.units.read(dictionary);
        let input = self.input(0.0, feedback, dictionary);
        self.axis.take_over(&input.actual);
        self.mode = OperationMode::begin(mode, &mut self.axis, &input);
        self.stop = None;
        self.is_fresh = true;
    }

    /// Handles bits 4 to 6 and 8 of a controlword in operation enabled, after [`begin`](Self::begin).
    pub fn on_controlword(
        &mut self,
        word: Controlword,
        feedback: &Feedback,
        dictionary: &Dictionary,
    ) {
        let is_rising_edge = bits::is_started(word) && !bits::is_started(self.word);
        self.word = word;
        let input = self.input(0.0, feedback, dictionary);
        self.mode.on_controlword(word, is_rising_edge, &mut self.axis, &input);
    }

    /// Advances by `dt` s in operation; zero when only a set-point has changed, which cyclic modes apply at once. Halt
    /// (bit 8) stops the motor as 605Dh selects, and holds it.
    pub fn step(
        &mut self,
        dt: f64,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> TorqueDemand {
        let input = self.input(dt, feedback, dictionary);
        let demand = if bits::is_halted(self.word) {
            self.halt(&input)
        } else {
            if self.stop.take().is_some() {
                self.mode.resume(&mut self.axis, &input);
            }
            self.mode.step(&mut self.axis, &input)
        };
        let actual = input.actual;
        self.show(&actual, dictionary);
        demand
    }

    /// Advances a stop on `ramp` by `dt` s; `None` at standstill, or 2 s after the end of the ramp (its start at the
    /// current limit). In torque modes a stop ends when the torque is zero.
    pub fn stop(
        &mut self,
        dt: f64,
        ramp: Ramp,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> Option<TorqueDemand> {
        if self.is_stopped() {
            return None;
        }
        let demand = self.brake_and_show(dt, ramp, feedback, dictionary);
        (!self.is_stopped()).then_some(demand)
    }

    /// Advances by `dt` s in the state that [`stop`](Self::stop) left: position held, or no torque in torque modes.
    pub fn hold(
        &mut self,
        dt: f64,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> TorqueDemand {
        let demand = self.brake_and_show(dt, Ramp::CurrentLimit, feedback, dictionary);
        TorqueDemand { status: bits::TARGET_REACHED, ..demand }
    }

    fn brake_and_show(
        &mut self,
        dt: f64,
        ramp: Ramp,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> TorqueDemand {
        let input = self.input(dt, feedback, dictionary);
        let demand = self.brake(ramp, &input);
        let actual = input.actual;
        self.show(&actual, dictionary);
        demand
    }

    fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.is_over())
    }

    fn input<'a>(
        &mut self,
        dt: f64,
        feedback: &Feedback,
        dictionary: &'a Dictionary,
    ) -> StepInput<'a> {
        let dt = if dt.is_nan() { 0.0 } else { dt.clamp(0.0, MAX_STEP) };
        StepInput { dt, actual: self.axis.shaft.sense(feedback), dictionary }
    }

    fn brake(&mut self, ramp: Ramp, input: &StepInput<'_>) -> TorqueDemand {
        let stopped = self.mode.stopped();
        let stop = self.stop.get_or_insert_with(|| Stop::new(ramp, stopped));
        stop.set_ramp(ramp);
        let torque = stop.step(&mut self.axis, input);
        TorqueDemand { per_mille: torque.value, is_limited: torque.is_limited, status: 0, error: 0 }
    }

    fn halt(&mut self, input: &StepInput<'_>) -> TorqueDemand {
        let ramp = match input.dictionary.i16(Object::HALT_OPTION) {
            2 => Ramp::QuickStop,
            3 | 4 => Ramp::CurrentLimit,
            _ => Ramp::SlowDown,
        };
        let demand = self.brake(ramp, input);
        let is_over = self.is_stopped();
        TorqueDemand { status: self.mode.halted(is_over, &self.axis, input), ..demand }
    }

    /// Writes the demand objects.
    fn show(&mut self, actual: &shaft::Actual, dictionary: &mut Dictionary) {
        if self.is_fresh || self.mode.has_position_demand() {
            self.axis.show_position(actual, dictionary);
        }
        if self.is_fresh || self.mode.stopped() == stop::StopQuantity::Velocity {
            self.axis.show_velocity(dictionary);
        }
        self.is_fresh = false;
    }
}

/// Maximum time of one step, in s.
const MAX_STEP: f64 = 1.0;
