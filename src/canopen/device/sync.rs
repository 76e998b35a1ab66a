//! SYNC, as a device hears it: where (1005h), counted or not (1019h), and how long after it synchronous PDOs
//! may come and go (1007h): CiA 301, 7.2.5 and 7.5.2.5 to 7.5.2.7.
//!
//! The communication cycle period (1006h) is the producer's. CiA 301 gives a device that only listens
//! nothing to do when a SYNC stays away; whoever must know watches an RPDO (sub-index 5).

use std::time::Duration;

use crate::abort::AbortCode;
use crate::device::parameter::consumed;
use crate::dictionary::Dictionary;
use crate::frame::COB_ID_MAX;
use crate::frame::Frame;
use crate::object::Object;
use units::time::Instant;

/// What a device knows of SYNC.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SyncConsumer {
    cob_id: u16,
    /// One where they are counted, any number where the device knows no counting.
    bytes: Option<usize>,
    window: Option<Duration>,
    /// The end of the window, from the first SYNC on.
    closes: Option<Instant>,
}

impl SyncConsumer {
    /// Follows the dictionary. The window begins with the next SYNC.
    pub(super) fn configure(&mut self, dictionary: &Dictionary) {
        let identifier = dictionary.unsigned(Object::SYNC_COB_ID) & u32::from(COB_ID_MAX);
        let window = u64::from(dictionary.unsigned(Object::SYNC_WINDOW));
        let counts = dictionary.entry(Object::SYNC_OVERFLOW);
        *self = Self {
            cob_id: u16::try_from(identifier).unwrap_or(0),
            bytes: counts.map(|_| usize::from(dictionary.unsigned(Object::SYNC_OVERFLOW) > 0)),
            window: (window > 0).then_some(Duration::from_micros(window)),
            closes: None,
        };
    }

    /// Whether a frame is a SYNC, of whatever length.
    pub(super) const fn hears(&self, frame: &Frame) -> bool {
        frame.cob_id == self.cob_id
    }

    /// Takes a SYNC; false if it has another length than it should have.
    pub(super) fn take(&mut self, now: Instant, frame: &Frame) -> bool {
        let is_good = self.bytes.is_none_or(|bytes| bytes == frame.data().len());
        if is_good {
            self.closes = self.window.map(|window| now + window);
        }
        is_good
    }

    /// Whether synchronous PDOs may come and go.
    pub(super) fn is_open(&self, now: Instant) -> bool {
        self.closes.is_none_or(|closes| now <= closes)
    }
}

/// Whether SYNC may be heard where `raw` says (1005h).
///
/// # Errors
/// When it may not.
pub(super) fn may_listen(raw: u32) -> Result<(), AbortCode> {
    consumed(raw).map(|_| ())
}

/// Whether SYNCs may be counted up to `last` (1019h): not to 1, and nothing is changed while a cycle
/// period is set (CiA 301, 7.5.2.22).
///
/// # Errors
/// When they may not, or not now.
pub(super) fn may_count(dictionary: &Dictionary, last: u32) -> Result<(), AbortCode> {
    let is_changed = dictionary.unsigned(Object::SYNC_OVERFLOW) != last;
    if last == 1 {
        Err(AbortCode::VALUE_INVALID)
    } else if is_changed && dictionary.unsigned(Object::CYCLE_PERIOD) > 0 {
        Err(AbortCode::DEVICE_STATE)
    } else {
        Ok(())
    }
}
