//! Clocks of a device (CiA 301, 7.2.6, 7.5.2.15, 7.5.2.16). One runs since power-up and is sampled at every SYNC
//! (1013h), the other is set by TIME (1012h).
//!
//! A constant 1013h indicates to a master that a device does not sample any more.

use std::time::Duration;

use crate::dictionary::Dictionary;
use crate::parameter::consumed;
use canopen::abort::AbortCode;
use canopen::frame::Frame;
use canopen::object::Object;
use canopen::time_stamp::{self, TimeOfDay};
use units::time::Instant;

/// Time of day.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// COB-ID of TIME; `None` if the device does not consume it.
    cob_id: Option<u16>,
    /// Last TIME message, and when it was received.
    last: Option<(Instant, TimeOfDay)>,
}

impl Clock {
    /// Reads the COB-ID of TIME (1012h).
    pub(super) fn configure(&mut self, dictionary: &Dictionary) {
        self.cob_id = time_stamp::consumed(dictionary.unsigned(Object::TIME_COB_ID));
    }

    /// COB-ID of TIME; `None` if the device does not consume it.
    pub(super) const fn cob_id(&self) -> Option<u16> {
        self.cob_id
    }

    /// Takes a TIME message; returns false for any other frame.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame) -> bool {
        if self.cob_id != Some(frame.cob_id) {
            return false;
        }
        if let Some(time) = TimeOfDay::decode(frame.data()) {
            self.last = Some((now, time));
        }
        true
    }

    /// Time of day since 1 January 1970; `None` before the first TIME message.
    pub(super) fn since_1970(&self, now: Instant) -> Option<Duration> {
        self.last.map(|(then, time)| time.since_1970() + now.since(then))
    }
}

/// Samples the running clock, in µs modulo 2³².
pub(super) fn stamp(now: Instant, dictionary: &mut Dictionary) {
    let [a, b, c, d, ..] = now.as_micros().to_le_bytes();
    dictionary.set(Object::HIGH_RESOLUTION_TIME, &[a, b, c, d]);
}

/// Checks a write of 1012h. The identifier must not change while TIME is consumed.
///
/// # Errors
/// Returns the abort code of a refused write.
pub(super) fn check_cob_id(old: u32, new: u32) -> Result<(), AbortCode> {
    let identifier = consumed(new)?;
    let is_moved = time_stamp::consumed(old).is_some_and(|before| before != identifier);
    let is_consumed = time_stamp::consumed(new).is_some();
    if is_moved && is_consumed { Err(AbortCode::DEVICE_STATE) } else { Ok(()) }
}
