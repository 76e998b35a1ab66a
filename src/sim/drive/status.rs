//! What a drive tells of itself in its objects.
//!
//! Torque is told in whole per mille, so that what trembles below does not make an event-driven TPDO talk.

use crate::drive::monitor::Monitor;
use crate::motion::Asked;
use crate::motion::Feedback;
use canopen::dictionary::Dictionary;
use canopen::drive::Statusword;
use canopen::object::Object;

/// What follows from its state and its task.
#[derive(Clone, Copy, Debug)]
pub(super) struct Status {
    /// 6041h.
    pub(super) statusword: Statusword,
    /// 6061h: the mode in force.
    pub(super) mode: i8,
    /// 6074h, in ‰ of rated torque.
    pub(super) torque_demand: f64,
    /// 603Fh: the last error.
    pub(super) error: u16,
}

impl Status {
    /// Tells it.
    pub(super) fn show(&self, dictionary: &mut Dictionary) {
        dictionary.set(Object::STATUSWORD, &self.statusword.0.to_le_bytes());
        dictionary.set(Object::MODE_DISPLAY, &self.mode.to_le_bytes());
        dictionary.set(Object::TORQUE_DEMAND, &whole(self.torque_demand).to_le_bytes());
        dictionary.set(Object::ERROR_CODE, &self.error.to_le_bytes());
    }
}

/// The statusword of a power stage whose state is told by `state`, and whose task is told by `asked`.
pub(super) fn statusword(state: Statusword, monitor: &Monitor, asked: &Asked) -> Statusword {
    let own = [
        (monitor.has_voltage(), Statusword::VOLTAGE_ENABLED),
        (monitor.has_warning(), Statusword::WARNING),
        (asked.is_limited, Statusword::INTERNAL_LIMIT),
    ];
    let bits = own.into_iter().filter(|(is_set, _)| *is_set).fold(0, |bits, (_, bit)| bits | bit);
    Statusword(state.0 | bits | Statusword::REMOTE | asked.status & OF_THE_MODE)
}

/// Bits 10, 12 and 13.
const OF_THE_MODE: u16 = 1 << 10 | 1 << 12 | 1 << 13;

/// Tells what the motor does: where it is, in position units, how fast, and with which torque.
pub(super) fn show_motor(
    position: i32,
    velocity: i32,
    feedback: &Feedback,
    dictionary: &mut Dictionary,
) {
    let per_mille = whole(feedback.per_mille).to_le_bytes();
    dictionary.set(Object::POSITION_ACTUAL, &position.to_le_bytes());
    dictionary.set(Object::POSITION_INTERNAL, &feedback.position.to_le_bytes());
    dictionary.set(Object::VELOCITY_ACTUAL, &velocity.to_le_bytes());
    dictionary.set(Object::TORQUE_ACTUAL, &per_mille);
    dictionary.set(Object::CURRENT_ACTUAL, &per_mille);
}

/// Tells what is watched: in 0.1 °C, mV and levels.
pub(super) fn show_monitor(monitor: &Monitor, dictionary: &mut Dictionary) {
    dictionary.set(Object::WINDING_TEMPERATURE, &whole(10.0 * monitor.temperature).to_le_bytes());
    dictionary.set(Object::LINK_VOLTAGE, &natural(1e3 * monitor.link_voltage).to_le_bytes());
    dictionary.set(Object::DRIVE_INPUTS, &monitor.inputs.word().to_le_bytes());
}

/// An object of 16 bits; zero if it is not there.
pub(super) fn word(dictionary: &Dictionary, object: Object) -> u16 {
    let [low, high, ..] = dictionary.unsigned(object).to_le_bytes();
    u16::from_le_bytes([low, high])
}

/// The nearest whole number; the nearest end beyond 16 bits.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "such a cast saturates; NaN becomes 0"
)]
pub(super) fn whole(value: f64) -> i16 {
    value.round() as i16
}

/// The nearest natural number; the nearest end beyond 32 bits.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "such a cast saturates; NaN becomes 0"
)]
pub(super) fn natural(value: f64) -> u32 {
    value.round() as u32
}
