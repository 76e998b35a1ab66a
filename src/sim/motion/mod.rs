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
pub struct Motion {}

impl Motion {
    /// The mode (6060h) has changed, or the power stage has been enabled: the motor is held where it is.
    pub fn begin(&mut self, _mode: i8, _feedback: &Feedback, _dictionary: &Dictionary) {}

    /// A controlword has come, whose bits 4 to 6 and 8 the mode has a meaning for.
    pub fn on_controlword(
        &mut self,
        _word: Controlword,
        _feedback: &Feedback,
        _dictionary: &Dictionary,
    ) {
    }

    /// `dt` s have passed in operation; zero when only a set-point has changed, which the cyclic modes
    /// take at once.
    pub fn step(&mut self, _dt: f64, _feedback: &Feedback, dictionary: &mut Dictionary) -> Asked {
        Asked { per_mille: f64::from(dictionary.i16(Object::TARGET_TORQUE)), ..Asked::default() }
    }

    /// `dt` s have passed while it stops on `ramp`; `None` once it stands still.
    pub fn stop(
        &mut self,
        _dt: f64,
        _ramp: Ramp,
        _feedback: &Feedback,
        _dictionary: &mut Dictionary,
    ) -> Option<Asked> {
        None
    }
}
