//! One SDO transfer, seen from the client (CiA 301, 7.2.4.3): expedited or segmented, up or down.
//!
//! A reply counts only if it comes from the node that was asked *and* names the object that was asked
//! for; everything else, late replies and stale aborts included, is passed over, and the deadline of
//! the request ends the wait. (Segments name no object. A server sends in order, so none can be left
//! over once the reply that opened the transfer is here.) A transfer broken off on this side tells the
//! server so. No block transfer; one transfer at a time and node, which is for the owner to keep.

use std::time::Duration;

use canopen_rs::Address;
use canopen_rs::ByteString;
use canopen_rs::NodeId;
use canopen_rs::Value;
use canopen_rs::sdo::SEGMENT_DATA_MAX;
use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::decode_abort;
use canopen_rs::sdo::decode_data_segment;
use canopen_rs::sdo::decode_download_response;
use canopen_rs::sdo::decode_download_segment_response;
use canopen_rs::sdo::encode_data_segment;
use canopen_rs::sdo::encode_download_expedited;
use canopen_rs::sdo::encode_download_initiate_segmented;
use canopen_rs::sdo::encode_upload_request;
use canopen_rs::sdo::encode_upload_segment_request;
use canopen_rs::sdo::request_cob_id;
use canopen_rs::sdo::response_cob_id;
use thiserror::Error;

use crate::canopen::abort::AbortCode;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::time::Instant;

/// The largest value carried either way, in bytes.
pub const MAX_BYTES: usize = 65_536;

/// What an object holds, as far as the transfer can tell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Content {
    bytes: Vec<u8>,
    /// Expedited without a size: how many of the four bytes count is not said.
    unsized_reply: bool,
}

impl Content {
    /// Every byte there is; a reply that does not tell its size has four.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The `size` bytes of the object's type, `None` if the node sent another number of them.
    pub fn exactly(&self, size: usize) -> Option<&[u8]> {
        if self.unsized_reply { self.bytes.get(..size) } else { Some(self.bytes()) }
            .filter(|bytes| bytes.len() == size)
    }
}

/// Why a transfer failed, and on which side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SdoError {
    /// The node aborted it.
    #[error("refused: {0}")]
    Refused(AbortCode),
    /// This side aborted it, and told the node.
    #[error("broken off: {0}")]
    BrokenOff(AbortCode),
    /// The node did not reply in time; this side aborted it, and told the node.
    #[error("no answer")]
    Silent,
}

/// A finished transfer: what was read, or nothing after a write.
pub type Outcome = Result<Content, SdoError>;

/// One transfer between its request and its outcome.
#[derive(Clone, Debug)]
pub struct Transfer {
    node: NodeId,
    object: Object,
    timeout: Duration,
    /// Of the request that is out; `None` once finished.
    deadline: Option<Instant>,
    phase: Phase,
    /// Toggle bit of the next segment.
    toggle: bool,
    /// Received so far, or all there is to send.
    bytes: Vec<u8>,
}

/// Which reply is waited for.
#[derive(Clone, Copy, Debug)]
enum Phase {
    Reading,
    ReadingSegments { declared: Option<usize> },
    Writing,
    WritingSegments { sent: usize },
    Finished,
}

impl Transfer {
    /// Reads `object` of `node`; every request has `timeout` for its reply.
    pub fn read(
        node: NodeId,
        object: Object,
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let mut transfer = Self::new(node, object, timeout, Phase::Reading, Vec::new());
        transfer.request(now, encode_upload_request(address(object)), out);
        transfer
    }

    /// Writes `bytes`, little-endian, to `object` of `node`; every request has `timeout` for its reply.
    ///
    /// # Errors
    /// When there are more than [`MAX_BYTES`]; then nothing is sent.
    pub fn write(
        node: NodeId,
        object: Object,
        bytes: Vec<u8>,
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Result<Self, SdoError> {
        let too_long = SdoError::BrokenOff(AbortCode::OUT_OF_MEMORY);
        let size = u32::try_from(bytes.len()).map_err(|_| too_long)?;
        if bytes.len() > MAX_BYTES {
            return Err(too_long);
        }
        let expedited = ByteString::from_bytes(&bytes)
            .and_then(|bytes| encode_download_expedited(address(object), &Value::Domain(bytes)));
        let payload =
            expedited.unwrap_or_else(|_| encode_download_initiate_segmented(address(object), size));
        let mut transfer = Self::new(node, object, timeout, Phase::Writing, bytes);
        transfer.request(now, payload, out);
        Ok(transfer)
    }

    const fn new(
        node: NodeId,
        object: Object,
        timeout: Duration,
        phase: Phase,
        bytes: Vec<u8>,
    ) -> Self {
        Self { node, object, timeout, deadline: None, phase, toggle: false, bytes }
    }

    /// Takes one received frame; requests are appended to `out`.
    pub fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Outcome> {
        if frame.cob_id != response_cob_id(self.node) {
            return None;
        }
        let payload = frame.data().try_into().ok()?;
        if let Ok((address, code)) = decode_abort(&payload) {
            let ours = self.deadline.is_some() && self.is_for_us(address);
            return ours.then(|| self.finish(Err(SdoError::Refused(AbortCode(code)))));
        }
        match self.phase {
            Phase::Reading => self.on_upload_response(now, payload, out),
            Phase::ReadingSegments { declared } => self.on_segment(now, &payload, declared, out),
            Phase::Writing => {
                let confirmed = decode_download_response(&payload).ok()?;
                if !self.is_for_us(confirmed) {
                    return None;
                }
                if matches!(self.bytes.len(), 1..=4) {
                    return Some(self.finish(Ok(Content::default())));
                }
                self.send_segment(now, 0, out);
                None
            }
            Phase::WritingSegments { sent } => {
                let toggle = decode_download_segment_response(&payload).ok()?;
                if toggle != self.toggle {
                    return Some(self.break_off(AbortCode::TOGGLE_NOT_ALTERNATED, out));
                }
                if sent == self.bytes.len() {
                    return Some(self.finish(Ok(Content::default())));
                }
                self.toggle = !self.toggle;
                self.send_segment(now, sent, out);
                None
            }
            Phase::Finished => None,
        }
    }

    /// Ends the wait for a reply whose deadline has come.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Outcome> {
        if self.deadline.is_none_or(|deadline| now < deadline) {
            return None;
        }
        self.send_abort(AbortCode::TIMED_OUT, out);
        Some(self.finish(Err(SdoError::Silent)))
    }

    /// When the wait for a reply ends; `None` once finished.
    pub const fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// The reply to an upload request: all of a short value, or the size of a longer one.
    fn on_upload_response(
        &mut self,
        now: Instant,
        payload: SdoPayload,
        out: &mut Vec<Frame>,
    ) -> Option<Outcome> {
        let [command, low, high, sub, four @ ..] = payload;
        let about = Address::new(u16::from_le_bytes([low, high]), sub);
        if command >> 5 != SCS_UPLOAD || !self.is_for_us(about) {
            return None;
        }
        let (expedited, sized) = (command & EXPEDITED != 0, command & SIZE_INDICATED != 0);
        if expedited {
            let unused = if sized { usize::from(command >> 2 & 3) } else { 0 };
            let bytes = four.into_iter().take(4 - unused).collect();
            return Some(self.finish(Ok(Content { bytes, unsized_reply: !sized })));
        }
        let declared = if sized { usize::try_from(u32::from_le_bytes(four)).ok() } else { None };
        if declared.is_some_and(|declared| declared > MAX_BYTES) {
            return Some(self.break_off(AbortCode::OUT_OF_MEMORY, out));
        }
        self.phase = Phase::ReadingSegments { declared };
        self.request(now, encode_upload_segment_request(self.toggle), out);
        None
    }

    /// One segment of a longer value.
    fn on_segment(
        &mut self,
        now: Instant,
        payload: &SdoPayload,
        declared: Option<usize>,
        out: &mut Vec<Frame>,
    ) -> Option<Outcome> {
        let segment = decode_data_segment(payload).ok()?;
        if segment.toggle != self.toggle {
            return Some(self.break_off(AbortCode::TOGGLE_NOT_ALTERNATED, out));
        }
        self.bytes.extend_from_slice(segment.data);
        if self.bytes.len() > declared.unwrap_or(MAX_BYTES) {
            let code = declared.map_or(AbortCode::OUT_OF_MEMORY, |_| AbortCode::LENGTH_TOO_HIGH);
            return Some(self.break_off(code, out));
        }
        if segment.last {
            if declared.is_some_and(|declared| self.bytes.len() < declared) {
                return Some(self.break_off(AbortCode::LENGTH_TOO_LOW, out));
            }
            let bytes = std::mem::take(&mut self.bytes);
            return Some(self.finish(Ok(Content { bytes, unsized_reply: false })));
        }
        if segment.data.is_empty() {
            // Nothing and more to come: this could go on for ever.
            return Some(self.break_off(AbortCode::COMMAND_UNKNOWN, out));
        }
        self.toggle = !self.toggle;
        self.request(now, encode_upload_segment_request(self.toggle), out);
        None
    }

    /// Sends the segment that starts at byte `sent`.
    fn send_segment(&mut self, now: Instant, sent: usize, out: &mut Vec<Frame>) {
        let rest = self.bytes.get(sent..).unwrap_or_default();
        let piece = rest.get(..SEGMENT_DATA_MAX).unwrap_or(rest);
        let (last, next) = (piece.len() == rest.len(), sent + piece.len());
        if let Ok(payload) = encode_data_segment(piece, self.toggle, last) {
            self.phase = Phase::WritingSegments { sent: next };
            self.request(now, payload, out);
        }
    }

    fn is_for_us(&self, address: Address) -> bool {
        address == Address::new(self.object.index, self.object.sub)
    }

    fn request(&mut self, now: Instant, payload: SdoPayload, out: &mut Vec<Frame>) {
        self.deadline = Some(now + self.timeout);
        out.push(Frame::new(request_cob_id(self.node), payload));
    }

    fn break_off(&mut self, code: AbortCode, out: &mut Vec<Frame>) -> Outcome {
        self.send_abort(code, out);
        self.finish(Err(SdoError::BrokenOff(code)))
    }

    fn send_abort(&self, code: AbortCode, out: &mut Vec<Frame>) {
        let [low, high] = self.object.index.to_le_bytes();
        let [c0, c1, c2, c3] = code.0.to_le_bytes();
        let payload = [CS_ABORT, low, high, self.object.sub, c0, c1, c2, c3];
        out.push(Frame::new(request_cob_id(self.node), payload));
    }

    fn finish(&mut self, outcome: Outcome) -> Outcome {
        self.phase = Phase::Finished;
        self.deadline = None;
        outcome
    }
}

const fn address(object: Object) -> Address {
    Address::new(object.index, object.sub)
}

/// Server command specifier of an upload response, in the three highest bits.
const SCS_UPLOAD: u8 = 2;
/// Bit e: the value is in this frame.
const EXPEDITED: u8 = 1 << 1;
/// Bit s: how long it is, is said.
const SIZE_INDICATED: u8 = 1;
/// The whole command byte of an abort.
const CS_ABORT: u8 = 0x80;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TIMEOUT: Duration = Duration::from_millis(100);
    const NOW: Instant = Instant::ZERO;
    const POSITION: Object = Object::POSITION_ACTUAL;
    const NAME: Object = Object::DEVICE_NAME;

    fn node() -> NodeId {
        NodeId::new(5).unwrap()
    }

    fn reply(payload: [u8; 8]) -> Frame {
        Frame::new(0x585, payload)
    }

    fn reading(object: Object) -> (Transfer, Vec<Frame>) {
        let mut out = Vec::new();
        let transfer = Transfer::read(node(), object, TIMEOUT, NOW, &mut out);
        (transfer, out)
    }

    fn writing(object: Object, bytes: &[u8]) -> (Transfer, Vec<Frame>) {
        let mut out = Vec::new();
        let transfer =
            Transfer::write(node(), object, bytes.to_vec(), TIMEOUT, NOW, &mut out).unwrap();
        (transfer, out)
    }

    /// What a transfer makes of replies that come one after the other.
    fn replies(transfer: &mut Transfer, payloads: &[[u8; 8]]) -> (Option<Outcome>, Vec<Frame>) {
        let mut out = Vec::new();
        let outcome =
            payloads.iter().filter_map(|p| transfer.on_frame(NOW, &reply(*p), &mut out)).last();
        (outcome, out)
    }

    fn bytes_of(outcome: Option<Outcome>) -> Vec<u8> {
        outcome.expect("an outcome").expect("a value").bytes().to_vec()
    }

    #[test]
    fn a_request_is_the_frame_of_the_standard() {
        assert_eq!(reading(POSITION).1, [Frame::new(0x605, [0x40, 0x64, 0x60, 0, 0, 0, 0, 0])]);
        let cases: [(&[u8], [u8; 8]); 6] = [
            (&[1], [0x2F, 0x64, 0x60, 0, 1, 0, 0, 0]),
            (&[1, 2], [0x2B, 0x64, 0x60, 0, 1, 2, 0, 0]),
            (&[1, 2, 3], [0x27, 0x64, 0x60, 0, 1, 2, 3, 0]),
            (&[1, 2, 3, 4], [0x23, 0x64, 0x60, 0, 1, 2, 3, 4]),
            (&[1, 2, 3, 4, 5], [0x21, 0x64, 0x60, 0, 5, 0, 0, 0]),
            (&[], [0x21, 0x64, 0x60, 0, 0, 0, 0, 0]),
        ];
        for (bytes, payload) in cases {
            assert_eq!(writing(POSITION, bytes).1, [Frame::new(0x605, payload)]);
        }
    }

    #[test]
    fn an_expedited_reply_may_tell_its_size_or_not() {
        let cases: [(u8, &[u8]); 5] = [
            (0x43, &[1, 2, 3, 4]),
            (0x47, &[1, 2, 3]),
            (0x4B, &[1, 2]),
            (0x4F, &[1]),
            (0x42, &[1, 2, 3, 4]),
        ];
        for (command, bytes) in cases {
            let (mut transfer, _) = reading(POSITION);
            let (outcome, out) = replies(&mut transfer, &[[command, 0x64, 0x60, 0, 1, 2, 3, 4]]);
            assert_eq!(bytes_of(outcome), bytes);
            assert!(out.is_empty());
            assert_eq!(transfer.deadline(), None);
        }
    }

    #[test]
    fn only_a_reply_without_a_size_can_be_cut_to_the_size_of_the_type() {
        let told = Content { bytes: vec![1, 2, 3, 4], unsized_reply: false };
        assert_eq!((told.exactly(4), told.exactly(2)), (Some(&[1, 2, 3, 4][..]), None));
        let untold = Content { unsized_reply: true, ..told };
        assert_eq!((untold.exactly(2), untold.exactly(5)), (Some(&[1, 2][..]), None));
    }

    // Bug 1 of the client in canopen-rs 0.6.1: the address of a reply was never checked.

    #[test]
    fn a_late_reply_about_another_object_is_no_answer() {
        let (mut first, _) = reading(POSITION);
        let mut out = Vec::new();
        assert_eq!(first.on_time(NOW + TIMEOUT, &mut out), Some(Err(SdoError::Silent)));
        let (mut second, _) = reading(Object { index: 0x60FF, sub: 0 });
        let late = [0x43, 0x64, 0x60, 0, 9, 9, 9, 9];
        let ours = [0x43, 0xFF, 0x60, 0, 1, 2, 3, 4];
        let (outcome, _) = replies(&mut second, &[late]);
        assert_eq!(outcome, None);
        let (outcome, _) = replies(&mut second, &[ours]);
        assert_eq!(bytes_of(outcome), [1, 2, 3, 4]);
    }

    #[test]
    fn a_write_is_confirmed_only_by_its_own_object_and_node() {
        let (mut transfer, _) = writing(Object { index: 0x1018, sub: 2 }, &[1]);
        let stale =
            [[0x60, 0x18, 0x10, 1, 0, 0, 0, 0], [0x60, 0x17, 0x10, 2, 0, 0, 0, 0], [0x20; 8]];
        assert_eq!(replies(&mut transfer, &stale).0, None);
        let ours = [0x60, 0x18, 0x10, 2, 0, 0, 0, 0];
        let other_node = Frame::new(0x586, ours);
        assert_eq!(transfer.on_frame(NOW, &other_node, &mut Vec::new()), None);
        assert!(matches!(replies(&mut transfer, &[ours]).0, Some(Ok(_))));
    }

    #[test]
    fn a_stale_abort_kills_nothing() {
        let (mut transfer, _) = reading(POSITION);
        let stale = [0x80, 0xFF, 0x60, 0, 0, 0, 2, 6];
        assert_eq!(replies(&mut transfer, &[stale]).0, None);
        let ours = [0x80, 0x64, 0x60, 0, 0, 0, 2, 6];
        let refused = Err(SdoError::Refused(AbortCode::NO_OBJECT));
        assert_eq!(replies(&mut transfer, &[ours]).0, Some(refused));
        assert_eq!(replies(&mut transfer, &[ours]).0, None, "a finished transfer is deaf");
    }

    // Bug 2: no abort was ever sent, and a local failure looked like a remote one.

    #[test]
    fn a_timeout_is_told_to_the_server() {
        let (mut transfer, _) = reading(POSITION);
        let mut out = Vec::new();
        assert_eq!(transfer.on_time(NOW, &mut out), None);
        assert_eq!(transfer.on_time(NOW + TIMEOUT, &mut out), Some(Err(SdoError::Silent)));
        assert_eq!(out, [Frame::new(0x605, [0x80, 0x64, 0x60, 0, 0, 0, 4, 5])]);
        assert_eq!(transfer.on_time(NOW + TIMEOUT, &mut out), None);
    }

    #[test]
    fn a_repeated_segment_is_broken_off_here_and_told_to_the_server() {
        let (mut transfer, _) = reading(NAME);
        let opened = [0x41, 0x08, 0x10, 0, 14, 0, 0, 0];
        let (outcome, out) = replies(&mut transfer, &[opened, [0x00; 8], [0x00; 8]]);
        assert_eq!(outcome, Some(Err(SdoError::BrokenOff(AbortCode::TOGGLE_NOT_ALTERNATED))));
        assert_eq!(out.last(), Some(&Frame::new(0x605, [0x80, 0x08, 0x10, 0, 0, 0, 3, 5])));
    }

    #[test]
    fn a_segment_confirmed_twice_is_broken_off() {
        let (mut transfer, _) = writing(NAME, b"a long name of a device");
        let (confirmed, opened) = ([0x20, 0, 0, 0, 0, 0, 0, 0], [0x60, 0x08, 0x10, 0, 0, 0, 0, 0]);
        let (outcome, out) = replies(&mut transfer, &[opened, confirmed, confirmed]);
        assert_eq!(outcome, Some(Err(SdoError::BrokenOff(AbortCode::TOGGLE_NOT_ALTERNATED))));
        assert_eq!(out.len(), 3, "two segments and an abort");
    }

    // Bug 3: replies without a size were refused, expedited (42h, above) and segmented (40h).

    #[test]
    fn a_segmented_reply_may_leave_its_size_open() {
        let (mut transfer, _) = reading(NAME);
        let opened = [0x40, 0x08, 0x10, 0, 0, 0, 0, 0];
        let last = [0x1B, b'h', b'i', 0, 0, 0, 0, 0];
        let (outcome, out) = replies(
            &mut transfer,
            &[opened, [0x00, b'a', b'b', b'c', b'd', b'e', b'f', b'g'], last],
        );
        assert_eq!(bytes_of(outcome), b"abcdefghi");
        assert_eq!(out.len(), 2);
    }

    // Bug 4: nothing above 32 bytes, and the declared size was not compared.

    #[test]
    fn a_value_of_any_size_up_to_the_bound_is_read_as_it_was_written() {
        for size in [0_usize, 1, 4, 5, 7, 8, 14, 40, 1_000, MAX_BYTES] {
            let sent: Vec<u8> = (0..size).map(|place| u8::try_from(place % 251).unwrap()).collect();
            let (mut write, mut requests) = writing(NAME, &sent);
            let mut server = Server::default();
            let (mut wrote, mut out) = (None, Vec::new());
            while let Some(request) = requests.pop() {
                if let Some(answer) = server.answer(&request) {
                    wrote = write.on_frame(NOW, &answer, &mut out);
                }
                requests.append(&mut out);
            }
            assert!(matches!(wrote, Some(Ok(_))), "{size}");
            assert_eq!(server.value, sent);
            let (mut read, mut requests) = reading(NAME);
            let mut outcome = None;
            while let Some(request) = requests.pop() {
                if let Some(answer) = server.answer(&request) {
                    outcome = read.on_frame(NOW, &answer, &mut out);
                }
                requests.append(&mut out);
            }
            assert_eq!(bytes_of(outcome), sent);
        }
    }

    #[test]
    fn another_size_than_declared_is_no_value() {
        let last = [0x01, 1, 2, 3, 4, 5, 6, 7];
        for (declared, code) in [(20, AbortCode::LENGTH_TOO_LOW), (6, AbortCode::LENGTH_TOO_HIGH)] {
            let (mut transfer, _) = reading(NAME);
            let opened = [0x41, 0x08, 0x10, 0, declared, 0, 0, 0];
            let (outcome, _) = replies(&mut transfer, &[opened, last]);
            assert_eq!(outcome, Some(Err(SdoError::BrokenOff(code))));
        }
    }

    #[test]
    fn what_is_beyond_the_bound_is_refused_before_it_is_sent() {
        let (mut transfer, _) = reading(NAME);
        let opened = [0x41, 0x08, 0x10, 0, 1, 0, 1, 0];
        let too_long = Err(SdoError::BrokenOff(AbortCode::OUT_OF_MEMORY));
        assert_eq!(replies(&mut transfer, &[opened]).0, Some(too_long.clone()));
        let mut out = Vec::new();
        let write = Transfer::write(node(), NAME, vec![0; MAX_BYTES + 1], TIMEOUT, NOW, &mut out);
        assert_eq!(write.err(), too_long.err());
        assert!(out.is_empty());
    }

    #[test]
    fn a_server_that_sends_nothing_for_ever_is_broken_off() {
        let (mut transfer, _) = reading(NAME);
        let (outcome, _) = replies(
            &mut transfer,
            &[[0x40, 0x08, 0x10, 0, 0, 0, 0, 0], [0x0E, 0, 0, 0, 0, 0, 0, 0]],
        );
        assert_eq!(outcome, Some(Err(SdoError::BrokenOff(AbortCode::COMMAND_UNKNOWN))));
    }

    // Bug 5: a value of another width than asked for was an opaque error. Here bytes are bytes
    // (`only_a_reply_without_a_size_can_be_cut_to_the_size_of_the_type`).

    /// A server of one object, long enough for a transfer up and down.
    #[derive(Default)]
    struct Server {
        value: Vec<u8>,
        read: usize,
    }

    impl Server {
        fn answer(&mut self, request: &Frame) -> Option<Frame> {
            let p: [u8; 8] = request.data().try_into().unwrap();
            let mut r = [0, p[1], p[2], p[3], 0, 0, 0, 0];
            match p[0] >> 5 {
                0 => {
                    self.value.extend_from_slice(&p[1..8 - usize::from(p[0] >> 1 & 7)]);
                    r = [0x20 | p[0] & 0x10, 0, 0, 0, 0, 0, 0, 0];
                }
                1 => {
                    self.value.clear();
                    if p[0] & 2 != 0 {
                        self.value.extend_from_slice(&p[4..8 - usize::from(p[0] >> 2 & 3)]);
                    }
                    r[0] = 0x60;
                }
                2 => {
                    self.read = 0;
                    r[0] = 0x41;
                    r[4..].copy_from_slice(&u32::try_from(self.value.len()).unwrap().to_le_bytes());
                }
                3 => {
                    let rest = &self.value[self.read..];
                    let size = rest.len().min(7);
                    let last = u8::from(size == rest.len());
                    r = [0; 8];
                    r[0] = p[0] & 0x10 | (7 - u8::try_from(size).unwrap()) << 1 | last;
                    r[1..=size].copy_from_slice(&rest[..size]);
                    self.read += size;
                }
                _ => return None,
            }
            Some(reply(r))
        }
    }

    proptest! {
        #[test]
        fn any_frames_at_any_time_neither_panic_nor_outlast_the_deadline(
            write in proptest::option::of(proptest::collection::vec(any::<u8>(), 0..40)),
            steps in proptest::collection::vec(
                (0_u64..50_000, 0x584_u16..0x587, any::<[u8; 3]>(), proptest::collection::vec(any::<u8>(), 0..9)),
                0..100,
            ),
        ) {
            let (mut transfer, mut out) = match write {
                Some(bytes) => writing(NAME, &bytes),
                None => reading(NAME),
            };
            let mut now = NOW;
            let mut outcomes = 0;
            for (step, cob_id, [command, is_ours, is_random], mut data) in steps {
                now = now + Duration::from_micros(step);
                outcomes += u32::from(transfer.on_time(now, &mut out).is_some());
                if let ([first, low, high, sub, ..], true) = (&mut data[..], is_ours < 200) {
                    (*low, *high, *sub) = (0x08, 0x10, 0);
                    if is_random < 200 {
                        *first = [0x00, 0x01, 0x10, 0x11, 0x20, 0x30, 0x40, 0x60][usize::from(command & 7)];
                    }
                }
                let frame = Frame::from_slice(cob_id, &data).unwrap();
                outcomes += u32::from(transfer.on_frame(now, &frame, &mut out).is_some());
                prop_assert!(transfer.deadline().is_none_or(|due| now < due && due <= now + TIMEOUT));
            }
            if let Some(due) = transfer.deadline() {
                outcomes += u32::from(transfer.on_time(due, &mut out).is_some());
            }
            prop_assert_eq!(outcomes, 1);
            prop_assert_eq!(transfer.deadline(), None);
        }
    }
}
