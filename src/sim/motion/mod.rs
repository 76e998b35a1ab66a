//! Modes of operation: what a drive asks of its motor while it is enabled, and how it comes to a
//! standstill (CiA 402-2, 8 to 15).
//!
//! Not the power state machine, and not the current loop: set-points and what the encoder says come in,
//! a torque demand and what the objects tell of it go out.

use crate::canopen::dictionary::Dictionary;
use crate::canopen::drive::Controlword;
use crate::canopen::object::Object;

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
    mode: i8,
    word: Controlword,
    per_mille: f64,
}

impl Motion {
    /// An object has been written: units follow it. Those also do at every [`begin`](Self::begin).
    pub fn on_written(&mut self, _object: Object, _dictionary: &Dictionary) {}

    /// What 6064h shows: position units from home, of 32 bits that wrap. To be called often enough for
    /// the encoder not to turn 2³¹ increments in between, be the drive enabled or not.
    pub fn position(&mut self, feedback: &Feedback) -> i32 {
        feedback.position
    }

    /// What 606Ch shows: position units per second.
    pub fn velocity(&self, feedback: &Feedback) -> i32 {
        saturated(feedback.velocity)
    }

    /// The mode (6060h) has changed, or the power stage has been enabled: the motor is held where it is.
    pub fn begin(&mut self, mode: i8, _feedback: &Feedback, _dictionary: &Dictionary) {
        self.mode = mode;
    }

    /// A controlword has come, whose bits 4 to 6 and 8 the mode has a meaning for.
    pub fn on_controlword(
        &mut self,
        word: Controlword,
        _feedback: &Feedback,
        _dictionary: &Dictionary,
    ) {
        self.word = word;
    }

    /// `dt` s have passed in operation; zero when only a set-point has changed, which the cyclic modes
    /// take at once. A halt (bit 8) stops the motor as 605Dh says, and keeps it there.
    pub fn step(&mut self, _dt: f64, _feedback: &Feedback, dictionary: &mut Dictionary) -> Asked {
        let is_halted = self.word.0 & 1 << 8 != 0;
        self.per_mille =
            if is_halted { 0.0 } else { f64::from(dictionary.i16(Object::TARGET_TORQUE)) };
        Asked { per_mille: self.per_mille, ..Asked::default() }
    }

    /// `dt` s have passed while it stops on `ramp`; `None` once it stands still. In torque modes it does
    /// as soon as there is no torque.
    pub fn stop(
        &mut self,
        dt: f64,
        ramp: Ramp,
        _feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> Option<Asked> {
        let slope = f64::from(dictionary.unsigned(Object::TORQUE_SLOPE));
        let left = self.per_mille.abs() - slope * dt;
        let is_over = self.mode != 4 || ramp == Ramp::CurrentLimit || left <= 0.0;
        self.per_mille = if is_over { 0.0 } else { left * self.per_mille.signum() };
        (!is_over).then_some(Asked { per_mille: self.per_mille, ..Asked::default() })
    }

    /// `dt` s have passed in which it stays as [`stop`](Self::stop) has left it: at its place, or without
    /// torque in torque modes.
    pub fn hold(&mut self, _dt: f64, _feedback: &Feedback, _dictionary: &mut Dictionary) -> Asked {
        Asked::default()
    }
}

/// The nearest whole number; the nearest end beyond 32 bits.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "such a cast saturates; NaN becomes 0"
)]
fn saturated(value: f64) -> i32 {
    value.round() as i32
}
