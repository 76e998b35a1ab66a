//! SYNC consumer of a device: COB-ID (1005h), counter (1019h) and synchronous window (1007h); CiA 301, 7.2.5 and
//! 7.5.2.5 to 7.5.2.7.
//!
//! The communication cycle period (1006h) concerns the producer. CiA 301 defines no reaction of a consumer to a
//! lost SYNC; the timeout of an RPDO (sub-index 5) detects it.

use std::time::Duration;

use crate::dictionary::Dictionary;
use canopen::abort::AbortCode;
use canopen::frame::{COB_ID_MAX, Frame};
use canopen::object::Object;
use canopen::sync;
use units::time::Instant;

/// Reception of SYNC: COB-ID (1005h), length (1019h) and synchronous window (1007h).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SyncConsumer {
    cob_id: u16,
    /// Required length: 1 if SYNCs are counted. `None` accepts any, for devices without 1019h.
    bytes: Option<usize>,
    window: Option<Duration>,
    /// End of the window, from the first SYNC on.
    closes: Option<Instant>,
}

impl SyncConsumer {
    /// Applies the dictionary. The window starts with the next SYNC.
    pub(super) fn configure(&mut self, dictionary: &Dictionary) {
        // Some data sheets of drives with synchronous PDOs leave 1005h out.
        let cob_id = dictionary.optional(Object::SYNC_COB_ID).unwrap_or(u32::from(sync::COB_ID));
        let identifier = cob_id & u32::from(COB_ID_MAX);
        let window = u64::from(dictionary.unsigned(Object::SYNC_WINDOW));
        let counts = dictionary.entry(Object::SYNC_OVERFLOW);
        *self = Self {
            cob_id: u16::try_from(identifier).unwrap_or(0),
            bytes: counts.map(|_| usize::from(dictionary.unsigned(Object::SYNC_OVERFLOW) > 0)),
            window: (window > 0).then_some(Duration::from_micros(window)),
            closes: None,
        };
    }

    /// COB-ID of 1005h.
    pub(super) const fn cob_id(&self) -> u16 {
        self.cob_id
    }

    /// Returns whether a frame is a SYNC, of any length.
    pub(super) const fn is_sync(&self, frame: &Frame) -> bool {
        frame.cob_id == self.cob_id
    }

    /// Takes a SYNC; returns false if its length is wrong.
    pub(super) fn take(&mut self, now: Instant, frame: &Frame) -> bool {
        let is_good = self.bytes.is_none_or(|bytes| bytes == frame.data().len());
        if is_good {
            self.closes = self.window.map(|window| now + window);
        }
        is_good
    }

    /// Returns whether the synchronous window is open.
    pub(super) fn is_open(&self, now: Instant) -> bool {
        self.closes.is_none_or(|closes| now <= closes)
    }
}

/// Checks a write of 1019h: 1 is invalid, and nothing changes while a cycle period is set (CiA 301,
/// 7.5.2.22).
///
/// # Errors
/// Returns the abort code of a refused write.
pub(super) fn check_overflow(dictionary: &Dictionary, last: u32) -> Result<(), AbortCode> {
    let is_changed = dictionary.unsigned(Object::SYNC_OVERFLOW) != last;
    if last == 1 {
        Err(AbortCode::VALUE_INVALID)
    } else if is_changed && dictionary.unsigned(Object::CYCLE_PERIOD) > 0 {
        Err(AbortCode::DEVICE_STATE)
    } else {
        Ok(())
    }
}
