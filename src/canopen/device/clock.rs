//! The clocks of a device: one that runs since power-up and is sampled at every SYNC (1013h), and the one
//! on the wall, which it is told by TIME (1012h): CiA 301, 7.2.6, 7.5.2.15 and 7.5.2.16.
//!
//! A sample that stands still tells a master that what comes with it is old.

use std::time::Duration;

use crate::abort::AbortCode;
use crate::device::parameter::consumed;
use crate::dictionary::Dictionary;
use crate::frame::Frame;
use crate::object::Object;
use crate::time_stamp;
use crate::time_stamp::TimeOfDay;
use units::time::Instant;

/// What time it is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// Where TIME is heard, `None` for a device that does not listen.
    cob_id: Option<u16>,
    /// When it was told last, and what.
    told: Option<(Instant, TimeOfDay)>,
}

impl Clock {
    /// Listens where 1012h says.
    pub(super) fn configure(&mut self, dictionary: &Dictionary) {
        self.cob_id = time_stamp::consumed(dictionary.unsigned(Object::TIME_COB_ID));
    }

    /// Takes a TIME; false if the frame is none.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame) -> bool {
        if self.cob_id != Some(frame.cob_id) {
            return false;
        }
        if let Some(time) = TimeOfDay::decode(frame.data()) {
            self.told = Some((now, time));
        }
        true
    }

    /// What the clock on the wall shows, since 1 January 1970; `None` before it was told.
    pub(super) fn since_1970(&self, now: Instant) -> Option<Duration> {
        self.told.map(|(then, time)| time.since_1970() + now.since(then))
    }
}

/// Samples the clock that runs, in µs; it begins again from 0 after 2³² µs.
pub(super) fn stamp(now: Instant, dictionary: &mut Dictionary) {
    let [a, b, c, d, ..] = now.as_micros().to_le_bytes();
    dictionary.set(Object::HIGH_RESOLUTION_TIME, &[a, b, c, d]);
}

/// Whether 1012h may become `new`, having been `old`: its identifier stays while the device listens.
///
/// # Errors
/// When it may not, or not now.
pub(super) fn may_listen(old: u32, new: u32) -> Result<(), AbortCode> {
    let identifier = consumed(new)?;
    let is_moved = time_stamp::consumed(old).is_some_and(|before| before != identifier);
    let is_heard = time_stamp::consumed(new).is_some();
    if is_moved && is_heard { Err(AbortCode::DEVICE_STATE) } else { Ok(()) }
}
