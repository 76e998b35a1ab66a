//! Modes of operation: what a drive asks of its motor while it is enabled, and how it comes to a
//! standstill (CiA 402-2, 8 to 15).
//!
//! Not the power state machine, and not the current loop: set-points and what the encoder says come in,
//! a torque demand and what the objects tell of it go out.
//!
//! | files                                           | what                                        |
//! |-------------------------------------------------|---------------------------------------------|
//! | `mode`, `bits`                                  | which mode, and its bits                    |
//! | `profile_position`, `profile_velocity`, `torque`, `homing`, `cyclic` | the modes              |
//! | `stop`                                          | how the motor comes to a standstill         |
//! | `axis`                                          | what they share                             |
//! | `ramp`, `limits`                                | profile generators, and what bounds them    |
//! | `following`, `reached`, `lasting`               | windows in place, speed and time            |
//! | `servo`, `tuning`                               | the loops, and what they must know          |
//! | `shaft`, `units`                                | increments, home, and the master's units    |

mod axis;
mod bits;
mod cyclic;
#[cfg(test)]
mod fixture;
mod following;
mod homing;
mod lasting;
mod limits;
mod mode;
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

pub use tuning::Load;
pub use tuning::Tuning;
pub use tuning::Untunable;

use axis::Axis;
use axis::Moment;
use mode::Mode;
use stop::Stop;

use canopen::dictionary::Dictionary;
use canopen::drive::Controlword;
use canopen::object::Object;
use units::Units;

/// How often the drive's position and velocity loops run, in s.
pub const SERVO_PERIOD: f64 = 1e-3;

/// What the encoder and the current loop say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feedback {
    /// In increments, of 32 bits that wrap.
    pub position: i32,
    /// In increments/s.
    pub velocity: f64,
    /// The torque the motor makes, in ‰ of rated torque.
    pub per_mille: f64,
}

/// What a mode asks for, and tells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// Of the current loop, in ‰ of rated torque; within every limit.
    pub per_mille: f64,
    /// Bits 10, 12 and 13 of the statusword, which each mode has its own meaning for.
    pub status: u16,
    /// A limit inside the drive holds it back (bit 11).
    pub is_limited: bool,
    /// What has gone wrong, as error code (603Fh); 0 for nothing.
    pub error: u16,
}

/// How a stop is made (605Ah to 605Eh).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// On the deceleration of the profile, 6084h.
    SlowDown,
    /// On the deceleration of a quick stop, 6085h.
    QuickStop,
    /// With all the torque there is.
    CurrentLimit,
}

/// The mode a drive is in, and what it has in mind.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    axis: Axis,
    mode: Mode,
    word: Controlword,
    /// Made, by a halt or from outside, and not yet left by a step.
    stop: Option<Stop>,
    /// The objects still tell of another mode.
    is_fresh: bool,
}

impl Motion {
    /// In no mode, behind a servo that knows its mechanics, in the units of the objects.
    pub fn new(tuning: Tuning, dictionary: &Dictionary) -> Self {
        Self { axis: Axis::new(tuning, Units::of(dictionary)), ..Self::default() }
    }

    /// An object has been written: units follow it. Those also do at every [`begin`](Self::begin).
    pub fn on_written(&mut self, object: Object, dictionary: &Dictionary) {
        if Units::depend_on(object) {
            self.axis.shaft.units = Units::of(dictionary);
        }
    }

    /// What 6064h shows: position units from home, of 32 bits that wrap. To be called often enough for
    /// the encoder not to turn 2³¹ increments in between, be the drive enabled or not.
    pub fn position(&mut self, feedback: &Feedback) -> i32 {
        let actual = self.axis.shaft.sense(feedback);
        self.axis.shaft.shown(actual.place)
    }

    /// What 606Ch shows: position units per second.
    pub fn velocity(&self, feedback: &Feedback) -> i32 {
        units::saturated(self.axis.shaft.units.velocity_shown(feedback.velocity))
    }

    /// The mode (6060h) has changed, or the power stage has been enabled: the motor is held where it is.
    pub fn begin(&mut self, mode: i8, feedback: &Feedback, dictionary: &Dictionary) {
        self.axis.shaft.units = Units::of(dictionary);
        let moment = self.moment(0.0, feedback, dictionary);
        self.axis.take_over(&moment.actual);
        self.mode = Mode::begin(mode, &mut self.axis, &moment);
        self.stop = None;
        self.is_fresh = true;
    }

    /// A controlword has come in operation, be it the one that enables it and has made the mode
    /// [`begin`](Self::begin): its bits 4 to 6 and 8 have a meaning for the mode. A homing without a way
    /// is over with it.
    pub fn on_controlword(
        &mut self,
        word: Controlword,
        feedback: &Feedback,
        dictionary: &Dictionary,
    ) {
        let has_risen = bits::is_started(word) && !bits::is_started(self.word);
        self.word = word;
        let moment = self.moment(0.0, feedback, dictionary);
        self.mode.on_controlword(word, has_risen, &mut self.axis, &moment);
    }

    /// `dt` s have passed in operation; zero when only a set-point has changed, which the cyclic modes
    /// take at once. A halt (bit 8) stops the motor as 605Dh says, and keeps it there.
    pub fn step(&mut self, dt: f64, feedback: &Feedback, dictionary: &mut Dictionary) -> Asked {
        let moment = self.moment(dt, feedback, dictionary);
        let asked = if bits::is_halted(self.word) {
            self.halt(&moment)
        } else {
            if self.stop.take().is_some() {
                self.mode.resume(&mut self.axis, &moment);
            }
            self.mode.step(&mut self.axis, &moment)
        };
        let actual = moment.actual;
        self.show(&actual, dictionary);
        asked
    }

    /// `dt` s have passed while it stops on `ramp`; `None` once it stands still, or has not come to do so
    /// 2 s after its ramp has ended (or, at the current limit, has begun). In torque modes it is over as
    /// soon as there is no torque.
    pub fn stop(
        &mut self,
        dt: f64,
        ramp: Ramp,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> Option<Asked> {
        if self.is_stopped() {
            return None;
        }
        let asked = self.brake_and_show(dt, ramp, feedback, dictionary);
        (!self.is_stopped()).then_some(asked)
    }

    /// `dt` s have passed in which it stays as [`stop`](Self::stop) has left it: at its place, or without
    /// torque in torque modes.
    pub fn hold(&mut self, dt: f64, feedback: &Feedback, dictionary: &mut Dictionary) -> Asked {
        let asked = self.brake_and_show(dt, Ramp::CurrentLimit, feedback, dictionary);
        Asked { status: bits::TARGET_REACHED, ..asked }
    }

    fn brake_and_show(
        &mut self,
        dt: f64,
        ramp: Ramp,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> Asked {
        let moment = self.moment(dt, feedback, dictionary);
        let asked = self.brake(ramp, &moment);
        let actual = moment.actual;
        self.show(&actual, dictionary);
        asked
    }

    fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.is_over())
    }

    fn moment<'a>(
        &mut self,
        dt: f64,
        feedback: &Feedback,
        dictionary: &'a Dictionary,
    ) -> Moment<'a> {
        let dt = if dt.is_nan() { 0.0 } else { dt.clamp(0.0, LONGEST_STEP) };
        Moment { dt, actual: self.axis.shaft.sense(feedback), dictionary }
    }

    fn brake(&mut self, ramp: Ramp, moment: &Moment<'_>) -> Asked {
        let stopped = self.mode.stopped();
        let stop = self.stop.get_or_insert_with(|| Stop::new(ramp, stopped));
        stop.take(ramp);
        let torque = stop.step(&mut self.axis, moment);
        Asked { per_mille: torque.value, is_limited: torque.is_limited, status: 0, error: 0 }
    }

    fn halt(&mut self, moment: &Moment<'_>) -> Asked {
        let ramp = match moment.dictionary.i16(Object::HALT_OPTION) {
            2 => Ramp::QuickStop,
            3 | 4 => Ramp::CurrentLimit,
            _ => Ramp::SlowDown,
        };
        let asked = self.brake(ramp, moment);
        let is_over = self.is_stopped();
        Asked { status: self.mode.halted(is_over, &self.axis, moment), ..asked }
    }

    /// The objects tell what is demanded.
    fn show(&mut self, actual: &shaft::Actual, dictionary: &mut Dictionary) {
        if self.is_fresh || self.mode.has_place() {
            self.axis.show_place(actual, dictionary);
        }
        if self.is_fresh || self.mode.stopped() == stop::Stopped::Velocity {
            self.axis.show_velocity(dictionary);
        }
        self.is_fresh = false;
    }
}

/// More than this is not made up for, in s.
const LONGEST_STEP: f64 = 1.0;
