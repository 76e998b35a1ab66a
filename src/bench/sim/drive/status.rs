//! Actual values and statusword in the dictionary.
//!
//! Torque is in whole per mille: noise below that does not trigger an event-driven TPDO.

use crate::drive::monitor::Monitor;
use crate::motion::{Feedback, TorqueDemand};
use canopen::drive::Statusword;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Status that follows from state and task.
#[derive(Clone, Copy, Debug)]
pub(super) struct Status {
    /// Statusword (6041h).
    pub(super) statusword: Statusword,
    /// Active mode of operation (6061h).
    pub(super) mode: i8,
    /// Torque demand (6074h), in ‰ of rated torque.
    pub(super) torque_demand: f64,
    /// Error code (603Fh).
    pub(super) error: u16,
}

impl Status {
    /// Writes the objects.
    pub(super) fn show(&self, dictionary: &mut Dictionary) {
        dictionary.set(Object::STATUSWORD, &self.statusword.0.to_le_bytes());
        dictionary.set(Object::MODE_DISPLAY, &self.mode.to_le_bytes());
        dictionary.set(Object::TORQUE_DEMAND, &whole(self.torque_demand).to_le_bytes());
        dictionary.set(Object::ERROR_CODE, &self.error.to_le_bytes());
    }
}

/// Combines the statusword bits of `state`, monitor, mode and, in `manufacturer`, of the maker.
pub(super) fn statusword(
    state: Statusword,
    monitor: &Monitor,
    demand: &TorqueDemand,
    manufacturer: u16,
) -> Statusword {
    let own = [
        (monitor.has_voltage(), Statusword::VOLTAGE_ENABLED),
        (monitor.has_warning(), Statusword::WARNING),
        (demand.is_limited, Statusword::INTERNAL_LIMIT),
    ];
    let bits = own.into_iter().filter(|(is_set, _)| *is_set).fold(0, |bits, (_, bit)| bits | bit);
    Statusword(state.0 | bits | Statusword::REMOTE | demand.status & MODE_BITS | manufacturer)
}

/// Statusword bits of the mode: 10, 12 and 13.
const MODE_BITS: u16 = 1 << 10 | 1 << 12 | 1 << 13;

/// Writes the motor values: position in position units, velocity, torque.
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

/// Writes the monitored quantities: in 0.1 °C, mV and levels.
pub(super) fn show_monitor(monitor: &Monitor, dictionary: &mut Dictionary) {
    dictionary.set(Object::WINDING_TEMPERATURE, &whole(10.0 * monitor.temperature).to_le_bytes());
    dictionary.set(Object::LINK_VOLTAGE, &natural(1e3 * monitor.link_voltage).to_le_bytes());
    dictionary.set(Object::DRIVE_INPUTS, &monitor.inputs.word().to_le_bytes());
}

/// Returns an object of 16 bits; zero if absent.
pub(super) fn word(dictionary: &Dictionary, object: Object) -> u16 {
    let [low, high, ..] = dictionary.unsigned(object).to_le_bytes();
    u16::from_le_bytes([low, high])
}

/// Rounds to i16; saturates.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "a float-to-integer cast saturates; NaN becomes 0"
)]
pub(super) fn whole(value: f64) -> i16 {
    value.round() as i16
}

/// Rounds to u32; saturates.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float-to-integer cast saturates; NaN becomes 0"
)]
pub(super) fn natural(value: f64) -> u32 {
    value.round() as u32
}
