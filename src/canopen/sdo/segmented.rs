//! Client side of expedited and segmented transfers (CiA 301, 7.2.4.3.3 to 7.2.4.3.8). An expedited one has up to four
//! bytes in the initiating frame, a segmented one seven bytes per request and reply.

use canopen_rs::sdo::{
    SEGMENT_DATA_MAX, SdoPayload, decode_data_segment, decode_download_response,
    decode_download_segment_response, encode_data_segment, encode_download_expedited,
    encode_download_initiate_segmented, encode_upload_request, encode_upload_segment_request,
};
use canopen_rs::{Address, ByteString, Value};

use crate::abort::AbortCode;
use crate::sdo::command::{EXPEDITED, SCS_UPLOAD, SIZE_INDICATED};
use crate::sdo::content::{Content, Size};
use crate::sdo::step::Step;

/// Upload in progress.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    about: Address,
    limit: usize,
    /// Toggle bit of the next segment; `None` until the transfer is initiated.
    toggle: Option<bool>,
    declared: Option<usize>,
    bytes: Vec<u8>,
}

impl Upload {
    /// Returns an upload of at most `limit` bytes.
    pub(super) const fn new(about: Address, limit: usize) -> Self {
        Self { about, limit, toggle: None, declared: None, bytes: Vec::new() }
    }

    /// Initiating request.
    pub(super) fn request(&self) -> SdoPayload {
        encode_upload_request(self.about)
    }

    /// Takes a reply.
    pub(super) fn on_reply(&mut self, reply: &SdoPayload) -> Step {
        match self.toggle {
            None => self.on_opened(reply),
            Some(toggle) => self.on_segment(toggle, reply).into(),
        }
    }

    /// Takes the upload response: a short value, or the size of a longer one.
    fn on_opened(&mut self, reply: &SdoPayload) -> Step {
        let &[command, low, high, sub, ref four @ ..] = reply;
        let about = Address::new(u16::from_le_bytes([low, high]), sub);
        if command >> 5 != SCS_UPLOAD || about != self.about {
            return Step::Pass;
        }
        let (is_expedited, is_sized) = (command & EXPEDITED != 0, command & SIZE_INDICATED != 0);
        if is_expedited {
            let (unused, size) = match is_sized {
                true => (usize::from(command >> 2 & 3), Size::Indicated),
                false => (0, Size::Unknown),
            };
            let bytes = four.iter().copied().take(4 - unused).collect();
            return Step::Done(Content::new(bytes, size));
        }
        self.declared = is_sized.then(|| size(*four));
        if self.declared.is_some_and(|declared| declared > self.limit) {
            return Step::Abort(AbortCode::OUT_OF_MEMORY);
        }
        self.request_segment(false)
    }

    /// Takes a segment of up to seven bytes.
    fn on_segment(&mut self, toggle: bool, reply: &SdoPayload) -> Result<Step, AbortCode> {
        let Ok(segment) = decode_data_segment(reply) else { return Ok(Step::Pass) };
        if segment.toggle != toggle {
            return Err(AbortCode::TOGGLE_NOT_ALTERNATED);
        }
        self.bytes.extend_from_slice(segment.data);
        match self.declared {
            Some(declared) if self.bytes.len() > declared => Err(AbortCode::LENGTH_TOO_HIGH),
            None if self.bytes.len() > self.limit => Err(AbortCode::OUT_OF_MEMORY),
            Some(declared) if segment.last && self.bytes.len() < declared => {
                Err(AbortCode::LENGTH_TOO_LOW)
            }
            Some(_) | None if segment.last => {
                let size = if self.declared.is_some() { Size::Indicated } else { Size::Counted };
                Ok(Step::Done(Content::new(std::mem::take(&mut self.bytes), size)))
            }
            // An empty segment that is not the last: the transfer might never end.
            Some(_) | None if segment.data.is_empty() => Err(AbortCode::COMMAND_UNKNOWN),
            Some(_) | None => Ok(self.request_segment(!toggle)),
        }
    }

    fn request_segment(&mut self, toggle: bool) -> Step {
        self.toggle = Some(toggle);
        Step::Send(encode_upload_segment_request(toggle))
    }
}

/// Download in progress.
#[derive(Clone, Debug)]
pub(super) struct Download {
    about: Address,
    bytes: Vec<u8>,
    /// Number of bytes sent, and toggle bit of their segment; `None` until the transfer is initiated.
    sent: Option<(usize, bool)>,
}

impl Download {
    /// Returns a download that has sent nothing yet.
    pub(super) const fn new(about: Address, bytes: Vec<u8>) -> Self {
        Self { about, bytes, sent: None }
    }

    /// Initiating request; it carries a value of one to four bytes.
    pub(super) fn request(&self) -> SdoPayload {
        let expedited = ByteString::from_bytes(&self.bytes)
            .and_then(|bytes| encode_download_expedited(self.about, &Value::Domain(bytes)));
        let size = u32::try_from(self.bytes.len()).unwrap_or(u32::MAX);
        expedited.unwrap_or_else(|_| encode_download_initiate_segmented(self.about, size))
    }

    /// Takes a reply.
    pub(super) fn on_reply(&mut self, reply: &SdoPayload) -> Step {
        let Some((sent, toggle)) = self.sent else {
            return match decode_download_response(reply) {
                Ok(about) if about != self.about => Step::Pass,
                Ok(_) if matches!(self.bytes.len(), 1..=4) => Step::Done(Content::default()),
                Ok(_) => self.segment(0, false),
                Err(_) => Step::Pass,
            };
        };
        match decode_download_segment_response(reply) {
            Ok(confirmed) if confirmed != toggle => Step::Abort(AbortCode::TOGGLE_NOT_ALTERNATED),
            Ok(_) if sent == self.bytes.len() => Step::Done(Content::default()),
            Ok(_) => self.segment(sent, !toggle),
            Err(_) => Step::Pass,
        }
    }

    /// Segment that starts at byte `begin`.
    fn segment(&mut self, begin: usize, toggle: bool) -> Step {
        let rest = self.bytes.get(begin..).unwrap_or_default();
        let piece = rest.get(..SEGMENT_DATA_MAX).unwrap_or(rest);
        self.sent = Some((begin + piece.len(), toggle));
        match encode_data_segment(piece, toggle, piece.len() == rest.len()) {
            Ok(payload) => Step::Send(payload),
            Err(_) => Step::Abort(AbortCode::GENERAL_ERROR),
        }
    }
}

/// Decodes an indicated size.
pub(super) fn size(four: [u8; 4]) -> usize {
    usize::try_from(u32::from_le_bytes(four)).unwrap_or(usize::MAX)
}
