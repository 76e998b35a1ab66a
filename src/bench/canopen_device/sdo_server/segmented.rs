//! Server side of segmented transfers (CiA 301, 7.2.4.3.3 to 7.2.4.3.8): seven bytes per request and reply.

use canopen_rs::sdo::{SEGMENT_DATA_MAX, SdoPayload};

use crate::sdo_server::size::check_size;
use canopen::abort::AbortCode;
use canopen::sdo::MAX_BYTES;

/// Segmented upload in progress.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    bytes: Vec<u8>,
    sent: usize,
    /// Toggle bit of the next segment.
    toggle: bool,
}

impl Upload {
    /// Starts with the first byte and toggle bit 0.
    pub(super) const fn new(bytes: Vec<u8>) -> Self {
        Self { bytes, sent: 0, toggle: false }
    }

    /// Returns the next segment.
    ///
    /// # Errors
    /// Returns an abort code if the toggle bit does not alternate.
    pub(super) fn on_request(&mut self, command: u8) -> Result<SdoPayload, AbortCode> {
        if (command & TOGGLE != 0) != self.toggle {
            return Err(AbortCode::TOGGLE_NOT_ALTERNATED);
        }
        let rest = self.bytes.get(self.sent..).unwrap_or_default();
        let last = u8::from(rest.len() <= SEGMENT_DATA_MAX);
        let mut payload = [0; 8];
        let mut unused = 7;
        for (to, from) in payload.iter_mut().skip(1).zip(rest) {
            *to = *from;
            unused -= 1;
        }
        let [first, ..] = &mut payload;
        *first = SCS_UPLOAD_SEGMENT << 5 | command & TOGGLE | unused << 1 | last;
        self.sent += SEGMENT_DATA_MAX;
        self.toggle = !self.toggle;
        Ok(payload)
    }

    /// Returns whether the last segment was sent.
    pub(super) const fn is_over(&self) -> bool {
        self.sent > 0 && self.sent >= self.bytes.len()
    }
}

/// Segmented download in progress.
#[derive(Clone, Debug)]
pub(super) struct Download {
    bytes: Vec<u8>,
    /// Size of the announcement or of the object.
    size: Option<usize>,
    /// Toggle bit of the next segment.
    toggle: bool,
    is_over: bool,
}

impl Download {
    /// Returns a download of `size` bytes, where the size is known.
    pub(super) const fn new(size: Option<usize>) -> Self {
        Self { bytes: Vec::new(), size, toggle: false, is_over: false }
    }

    /// Takes a segment and returns its confirmation.
    ///
    /// # Errors
    /// Returns an abort code if the toggle bit does not alternate, or the size is wrong.
    pub(super) fn on_request(
        &mut self,
        [command, seven @ ..]: SdoPayload,
    ) -> Result<SdoPayload, AbortCode> {
        if (command & TOGGLE != 0) != self.toggle {
            return Err(AbortCode::TOGGLE_NOT_ALTERNATED);
        }
        let used = SEGMENT_DATA_MAX.saturating_sub(usize::from(command >> 1 & 7));
        self.bytes.extend_from_slice(seven.get(..used).unwrap_or_default());
        if self.bytes.len() > self.size.unwrap_or(MAX_BYTES) {
            let too_high = AbortCode::LENGTH_TOO_HIGH;
            return Err(self.size.map_or(AbortCode::OUT_OF_MEMORY, |_| too_high));
        }
        self.is_over = command & LAST != 0;
        if self.is_over {
            check_size(self.size, self.bytes.len())?;
        }
        self.toggle = !self.toggle;
        Ok([SCS_DOWNLOAD_SEGMENT << 5 | command & TOGGLE, 0, 0, 0, 0, 0, 0, 0])
    }

    /// Returns the value after the last segment.
    pub(super) fn value(&self) -> Option<&[u8]> {
        self.is_over.then_some(&self.bytes)
    }
}

const SCS_UPLOAD_SEGMENT: u8 = 0;
const SCS_DOWNLOAD_SEGMENT: u8 = 1;

/// Bit t of a segment: toggles.
pub(super) const TOGGLE: u8 = 1 << 4;
/// Bit c of a segment: it is the last one.
pub(super) const LAST: u8 = 1;
