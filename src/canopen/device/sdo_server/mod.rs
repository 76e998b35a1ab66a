//! The default SDO server (CiA 301, 7.2.4.3): expedited, segmented and by blocks, up and down, with and
//! without a declared size.
//!
//! One transfer at a time; whatever opens one ends the one before, and so does a client that falls
//! silent. Whether an object may be read or written, and what follows, is told by [`Access`]. While the
//! segments of a block come, every frame but an abort is one of them: their first byte is a number.

mod block;
mod segmented;

use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::block::encode_sub_response;
use canopen_rs::sdo::request_cob_id;
use canopen_rs::sdo::response_cob_id;

use crate::canopen::abort::AbortCode;
use crate::canopen::device::sdo_server::block::CONFIRMED;
use crate::canopen::device::sdo_server::block::Next;
use crate::canopen::device::sdo_server::block::SCS_BLOCK_DOWNLOAD;
use crate::canopen::device::sdo_server::block::SCS_BLOCK_UPLOAD;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::canopen::sdo::MAX_BYTES;
use crate::canopen::sdo::Promise;
use crate::canopen::sdo::Receiver;
use crate::time::Instant;

/// How long a client may be silent in the middle of a transfer.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);

/// After how much of that the segments of a block that were lost are asked for.
const NUDGE: Duration = Duration::from_millis(200);

/// Segments that a sub-block of a download has.
const BLOCK_SIZE: u8 = 127;

/// The objects, as a server sees them.
pub(super) trait Access {
    /// Puts what an object holds into `bytes`, which is empty.
    fn read(&self, object: Object, bytes: &mut Vec<u8>) -> Result<(), AbortCode>;

    /// The size of an object that may be written now, `None` where it may be any.
    fn size(&self, object: Object) -> Result<Option<usize>, AbortCode>;

    /// Writes, and does what follows from it. `bytes` have the size told.
    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode>;
}

/// The server of one device.
#[derive(Clone, Debug)]
pub(super) struct SdoServer {
    node: NodeId,
    transfer: Option<Transfer>,
    /// When the client was heard last.
    heard: Instant,
    has_nudged: bool,
}

/// A transfer under way.
#[derive(Clone, Debug)]
struct Transfer {
    object: Object,
    way: Way,
}

#[derive(Clone, Debug)]
enum Way {
    Up(segmented::Upload),
    Down(segmented::Download),
    BlockUp(block::Upload),
    BlockDown(block::Download),
}

/// What is answered, if anything; or why not, and over which object.
type Reply = Result<Option<SdoPayload>, (Object, AbortCode)>;

impl SdoServer {
    /// The server of `node`.
    pub(super) const fn new(node: NodeId) -> Self {
        Self { node, transfer: None, heard: Instant::ZERO, has_nudged: false }
    }

    /// Forgets the transfer under way.
    pub(super) fn reset(&mut self) {
        self.transfer = None;
    }

    /// The request in a frame, `None` if there is none of eight bytes for this server.
    pub(super) fn request(&self, frame: &Frame) -> Option<SdoPayload> {
        let is_ours = frame.cob_id == request_cob_id(self.node);
        if is_ours { frame.data().try_into().ok() } else { None }
    }

    /// Serves one request.
    pub(super) fn serve(
        &mut self,
        now: Instant,
        request: SdoPayload,
        objects: &mut impl Access,
        out: &mut Vec<Frame>,
    ) {
        self.heard = now;
        self.has_nudged = false;
        let reply = match self.on_block_segment(&request) {
            Some(reply) => reply,
            None => self.on_command(request, objects),
        };
        match reply {
            Ok(payload) => out.extend(payload.map(|payload| self.frame(payload))),
            Err((object, code)) => {
                self.transfer = None;
                out.push(self.frame(abort(object, code)));
            }
        }
        self.send_segments(out);
    }

    /// Asks for what was lost, or ends a transfer whose client has fallen silent.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if self.deadline().is_none_or(|due| now < due) {
            return;
        }
        let Some(Transfer { object, way }) = &mut self.transfer else { return };
        let (object, is_over) = (*object, now >= self.heard + PATIENCE);
        let payload = match way {
            Way::BlockDown(download) if !is_over => download.nudge(),
            Way::Up(_) | Way::Down(_) | Way::BlockUp(_) | Way::BlockDown(_) => {
                Some(abort(object, AbortCode::TIMED_OUT))
            }
        };
        self.has_nudged = true;
        if is_over {
            self.transfer = None;
        }
        out.extend(payload.map(|payload| self.frame(payload)));
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let may_nudge = match &self.transfer.as_ref()?.way {
            Way::BlockDown(_) => !self.has_nudged,
            Way::Up(_) | Way::Down(_) | Way::BlockUp(_) => false,
        };
        Some(self.heard + if may_nudge { NUDGE } else { PATIENCE })
    }

    /// Takes a request as a segment of a block, if segments come and it is no abort.
    fn on_block_segment(&mut self, request: &SdoPayload) -> Option<Reply> {
        let Transfer { object, way: Way::BlockDown(download) } = self.transfer.as_mut()? else {
            return None;
        };
        let ([command, ..], object) = (*request, *object);
        if !download.is_receiving() {
            return download.is_again(request).then_some(Ok(None));
        }
        let is_segment = command != CS_ABORT << 5;
        is_segment.then(|| download.on_segment(request).map_err(|code| (object, code)))
    }

    fn on_command(&mut self, request: SdoPayload, objects: &mut impl Access) -> Reply {
        let [command, low, high, sub, ..] = request;
        let object = Object { index: u16::from_le_bytes([low, high]), sub };
        let refused = |code| (object, code);
        let is_opening = match command >> 5 {
            CCS_BLOCK_UPLOAD => command & SUBCOMMAND == 0,
            CCS_BLOCK_DOWNLOAD => command & SUBCOMMAND & !SIZE_INDICATED_IN_BLOCK == 0,
            specifier => matches!(specifier, CCS_DOWNLOAD | CCS_UPLOAD | CS_ABORT),
        };
        if !is_opening {
            return self.on_request(request, objects);
        }
        self.transfer = None;
        match command >> 5 {
            CCS_DOWNLOAD => self.on_download(object, request, objects).map_err(refused),
            CCS_UPLOAD => self.on_upload(object, objects).map_err(refused),
            CCS_BLOCK_UPLOAD => self.on_block_upload(object, request, objects).map_err(refused),
            CCS_BLOCK_DOWNLOAD => self.on_block_download(object, request, objects).map_err(refused),
            _ => Ok(None),
        }
    }

    /// A request within a transfer.
    fn on_request(&mut self, request: SdoPayload, objects: &mut impl Access) -> Reply {
        let [command, ..] = request;
        let specifier = command >> 5;
        // A request that nothing has opened names no object.
        let nothing = Object { index: 0, sub: 0 };
        let Some(Transfer { object, way }) = &mut self.transfer else {
            return Err((nothing, AbortCode::COMMAND_UNKNOWN));
        };
        let object = *object;
        let refused = |code| (object, code);
        let (reply, is_over) = match way {
            Way::Up(upload) if specifier == CCS_UPLOAD_SEGMENT => {
                let reply = upload.on_request(command).map_err(refused)?;
                (Some(reply), upload.is_over())
            }
            Way::Down(download) if specifier == CCS_DOWNLOAD_SEGMENT => {
                let reply = download.on_request(request).map_err(refused)?;
                let value = download.value();
                if let Some(bytes) = value {
                    objects.write(object, bytes).map_err(refused)?;
                }
                (Some(reply), value.is_some())
            }
            Way::BlockUp(upload) if specifier == CCS_BLOCK_UPLOAD => {
                match upload.on_request(request).map_err(refused)? {
                    Next::Segments => (None, false),
                    Next::Reply(reply) => (Some(reply), false),
                    Next::Over => (None, true),
                }
            }
            Way::BlockDown(download) if specifier == CCS_BLOCK_DOWNLOAD => {
                let bytes = download.on_end(request).map_err(refused)?;
                objects.write(object, &bytes).map_err(refused)?;
                (Some(CONFIRMED), true)
            }
            Way::Up(_) | Way::Down(_) | Way::BlockUp(_) | Way::BlockDown(_) => {
                return Err(refused(AbortCode::COMMAND_UNKNOWN));
            }
        };
        if is_over {
            self.transfer = None;
        }
        Ok(reply)
    }

    /// A write begins, and with four bytes or fewer ends.
    fn on_download(
        &mut self,
        object: Object,
        [command, low, high, sub, four @ ..]: SdoPayload,
        objects: &mut impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let size = objects.size(object)?;
        let is_sized = command & SIZE_INDICATED != 0;
        if command & EXPEDITED != 0 {
            let told = is_sized.then_some(4 - usize::from(command >> 2 & 3));
            let taken = told.or(size).unwrap_or(4).min(4);
            let bytes = four.get(..taken).unwrap_or(&four);
            check_size(size, bytes.len())?;
            objects.write(object, bytes)?;
        } else {
            let size = agreed_size(size, is_sized, four)?;
            self.transfer =
                Some(Transfer { object, way: Way::Down(segmented::Download::new(size)) });
        }
        Ok(Some([SCS_DOWNLOAD << 5, low, high, sub, 0, 0, 0, 0]))
    }

    /// A read begins, and with one to four bytes ends.
    fn on_upload(
        &mut self,
        object: Object,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let mut bytes = Vec::new();
        objects.read(object, &mut bytes)?;
        Ok(Some(self.open_upload(object, bytes)))
    }

    /// The reply that opens an upload of `bytes`, expedited or segmented.
    fn open_upload(&mut self, object: Object, bytes: Vec<u8>) -> SdoPayload {
        let [low, high] = object.index.to_le_bytes();
        let (command, [a, b, c, d]) = match *bytes.as_slice() {
            [a] => (EXPEDITED | 3 << 2, [a, 0, 0, 0]),
            [a, b] => (EXPEDITED | 2 << 2, [a, b, 0, 0]),
            [a, b, c] => (EXPEDITED | 1 << 2, [a, b, c, 0]),
            [a, b, c, d] => (EXPEDITED, [a, b, c, d]),
            _ => {
                let size = announced(&bytes);
                self.transfer =
                    Some(Transfer { object, way: Way::Up(segmented::Upload::new(bytes)) });
                (0, size)
            }
        };
        [SCS_UPLOAD << 5 | SIZE_INDICATED | command, low, high, object.sub, a, b, c, d]
    }

    /// A read by blocks begins; a short one goes the other way, if the client says so.
    fn on_block_upload(
        &mut self,
        object: Object,
        [command, low, high, sub, block_size, threshold, ..]: SdoPayload,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let mut bytes = Vec::new();
        objects.read(object, &mut bytes)?;
        if threshold != 0 && bytes.len() <= usize::from(threshold) {
            return Ok(Some(self.open_upload(object, bytes)));
        }
        let [a, b, c, d] = announced(&bytes);
        let upload = block::Upload::new(bytes, block_size, command & CRC != 0)?;
        self.transfer = Some(Transfer { object, way: Way::BlockUp(upload) });
        let command = SCS_BLOCK_UPLOAD << 5 | command & CRC | SIZE_INDICATED_IN_BLOCK;
        Ok(Some([command, low, high, sub, a, b, c, d]))
    }

    /// A write by blocks begins.
    fn on_block_download(
        &mut self,
        object: Object,
        request: SdoPayload,
        objects: &impl Access,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        let [command, low, high, sub, four @ ..] = request;
        let is_sized = command & SIZE_INDICATED_IN_BLOCK != 0;
        let declared = agreed_size(objects.size(object)?, is_sized, four)?;
        let promise = Promise {
            declared,
            has_crc: command & CRC != 0,
            limit: MAX_BYTES,
            block_size: BLOCK_SIZE,
        };
        let nothing_yet = encode_sub_response(0, BLOCK_SIZE);
        let receiver = Receiver::new([request, nothing_yet], promise)?;
        self.transfer =
            Some(Transfer { object, way: Way::BlockDown(block::Download::new(receiver)) });
        let command = SCS_BLOCK_DOWNLOAD << 5 | command & CRC;
        Ok(Some([command, low, high, sub, BLOCK_SIZE, 0, 0, 0]))
    }

    /// Sends the sub-block that is due, all of it: the bus takes one frame after the other.
    fn send_segments(&mut self, out: &mut Vec<Frame>) {
        let cob_id = response_cob_id(self.node);
        if let Some(Transfer { way: Way::BlockUp(upload), .. }) = &mut self.transfer {
            out.extend(std::iter::from_fn(|| upload.next()).map(|it| Frame::new(cob_id, it)));
        }
    }

    fn frame(&self, payload: SdoPayload) -> Frame {
        Frame::new(response_cob_id(self.node), payload)
    }
}

/// The size a value must have: as its object has it, or as it was announced.
///
/// # Errors
/// When these are not the same, or more is announced than may come.
fn agreed_size(
    size: Option<usize>,
    is_announced: bool,
    four: [u8; 4],
) -> Result<Option<usize>, AbortCode> {
    if !is_announced {
        return Ok(size);
    }
    let announced = usize::try_from(u32::from_le_bytes(four)).unwrap_or(usize::MAX);
    check_size(size, announced)?;
    Ok(Some(announced))
}

/// Whether `found` bytes are what an object of this size takes.
fn check_size(size: Option<usize>, found: usize) -> Result<(), AbortCode> {
    match size {
        Some(size) if found > size => Err(AbortCode::LENGTH_TOO_HIGH),
        Some(size) if found < size => Err(AbortCode::LENGTH_TOO_LOW),
        None if found > MAX_BYTES => Err(AbortCode::OUT_OF_MEMORY),
        Some(_) | None => Ok(()),
    }
}

/// The size of a value, as it is announced.
fn announced(bytes: &[u8]) -> [u8; 4] {
    u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_le_bytes()
}

fn abort(object: Object, code: AbortCode) -> SdoPayload {
    let [low, high] = object.index.to_le_bytes();
    let [a, b, c, d] = code.0.to_le_bytes();
    [CS_ABORT << 5, low, high, object.sub, a, b, c, d]
}

// Command specifiers, in the three highest bits: of the client and of the server.
const CCS_DOWNLOAD_SEGMENT: u8 = 0;
const CCS_DOWNLOAD: u8 = 1;
const CCS_UPLOAD: u8 = 2;
const CCS_UPLOAD_SEGMENT: u8 = 3;
const CS_ABORT: u8 = 4;
const CCS_BLOCK_UPLOAD: u8 = 5;
const CCS_BLOCK_DOWNLOAD: u8 = 6;
const SCS_UPLOAD: u8 = 2;
const SCS_DOWNLOAD: u8 = 3;

/// Bit e: the value is in this frame.
const EXPEDITED: u8 = 1 << 1;
/// Bit s: how long it is, is said.
const SIZE_INDICATED: u8 = 1;
/// The same where block transfer has it.
const SIZE_INDICATED_IN_BLOCK: u8 = 1 << 1;
/// Bits cc and sc: a checksum is wanted, and there will be one. A server that offers one nobody wants
/// is misread by clients that look at sc alone.
const CRC: u8 = 1 << 2;
/// What a frame of a block transfer is.
const SUBCOMMAND: u8 = 3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::device::sdo_server::segmented::LAST;
    use crate::canopen::device::sdo_server::segmented::TOGGLE;
    use proptest::prelude::*;

    /// One object of any size, and one of two bytes.
    #[derive(Default)]
    struct Shelf {
        text: Vec<u8>,
        number: [u8; 2],
    }

    const TEXT: Object = Object { index: 0x2000, sub: 0 };
    const NUMBER: Object = Object { index: 0x2001, sub: 3 };

    impl Access for Shelf {
        fn read(&self, object: Object, bytes: &mut Vec<u8>) -> Result<(), AbortCode> {
            bytes.extend_from_slice(if object == TEXT { &self.text } else { &self.number });
            Ok(())
        }

        fn size(&self, object: Object) -> Result<Option<usize>, AbortCode> {
            match object {
                TEXT => Ok(None),
                NUMBER => Ok(Some(2)),
                _ => Err(AbortCode::NO_OBJECT),
            }
        }

        fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
            if object == TEXT {
                self.text = bytes.to_vec();
            } else {
                self.number = bytes.try_into().unwrap();
            }
            Ok(())
        }
    }

    fn server() -> SdoServer {
        SdoServer::new(NodeId::new(5).unwrap())
    }

    fn reply(server: &mut SdoServer, shelf: &mut Shelf, request: SdoPayload) -> SdoPayload {
        let replies = replies(server, shelf, request);
        assert_eq!(replies.len(), 1, "one reply");
        replies[0]
    }

    fn replies(server: &mut SdoServer, shelf: &mut Shelf, request: SdoPayload) -> Vec<SdoPayload> {
        let mut out = Vec::new();
        server.serve(Instant::ZERO, request, shelf, &mut out);
        assert!(out.iter().all(|frame| frame.cob_id == 0x585));
        out.iter().map(|frame| frame.data().try_into().unwrap()).collect()
    }

    fn refusal(object: Object, code: AbortCode) -> SdoPayload {
        abort(object, code)
    }

    #[test]
    fn a_text_goes_down_with_or_without_its_size_and_comes_up_again() {
        for size in [0, 1, 4, 6, 7, 8, 14, 15, 100] {
            let text: Vec<u8> = (0..size).collect();
            for initiate in [[0x21, 0, 0x20, 0, size, 0, 0, 0], [0x20, 0, 0x20, 0, 0, 0, 0, 0]] {
                let (mut server, mut shelf) = (server(), Shelf::default());
                let confirmed = reply(&mut server, &mut shelf, initiate);
                assert_eq!(confirmed, [0x60, 0, 0x20, 0, 0, 0, 0, 0]);
                let mut pieces: Vec<&[u8]> = text.chunks(7).collect();
                if pieces.is_empty() {
                    pieces.push(&[]);
                }
                for (place, piece) in pieces.iter().enumerate() {
                    let toggle = if place % 2 == 0 { 0 } else { TOGGLE };
                    let unused = u8::try_from(7 - piece.len()).unwrap();
                    let mut segment = [0; 8];
                    segment[0] = toggle | unused << 1 | u8::from(place + 1 == pieces.len());
                    segment[1..=piece.len()].copy_from_slice(piece);
                    let confirmed = reply(&mut server, &mut shelf, segment);
                    assert_eq!(confirmed, [0x20 | toggle, 0, 0, 0, 0, 0, 0, 0]);
                }
                assert_eq!(shelf.text, text);
                assert_eq!(uploaded(&mut server, &mut shelf), text);
            }
        }
    }

    fn uploaded(server: &mut SdoServer, shelf: &mut Shelf) -> Vec<u8> {
        let [command, _, _, _, four @ ..] = reply(server, shelf, [0x40, 0, 0x20, 0, 0, 0, 0, 0]);
        if command & EXPEDITED != 0 {
            return four[..4 - usize::from(command >> 2 & 3)].to_vec();
        }
        assert_eq!(command, 0x41);
        let (mut text, mut toggle) = (Vec::new(), 0);
        loop {
            let [command, seven @ ..] = reply(server, shelf, [0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(command & TOGGLE, toggle);
            text.extend_from_slice(&seven[..7 - usize::from(command >> 1 & 7)]);
            toggle ^= TOGGLE;
            if command & LAST != 0 {
                assert_eq!(text.len(), usize::try_from(u32::from_le_bytes(four)).unwrap());
                return text;
            }
        }
    }

    #[test]
    fn an_expedited_write_may_leave_its_size_to_the_object() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        let confirmed = reply(&mut server, &mut shelf, [0x22, 1, 0x20, 3, 7, 8, 9, 9]);
        assert_eq!(confirmed, [0x60, 1, 0x20, 3, 0, 0, 0, 0]);
        assert_eq!(shelf.number, [7, 8]);
        reply(&mut server, &mut shelf, [0x22, 0, 0x20, 0, 7, 8, 9, 9]);
        assert_eq!(shelf.text, [7, 8, 9, 9]);
    }

    #[test]
    fn a_wrong_length_is_refused_before_or_at_the_last_byte() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        for (request, code) in [
            ([0x21, 1, 0x20, 3, 3, 0, 0, 0], AbortCode::LENGTH_TOO_HIGH),
            ([0x21, 1, 0x20, 3, 1, 0, 0, 0], AbortCode::LENGTH_TOO_LOW),
            ([0x23, 1, 0x20, 3, 0, 0, 0, 0], AbortCode::LENGTH_TOO_HIGH),
            ([0x2F, 1, 0x20, 3, 0, 0, 0, 0], AbortCode::LENGTH_TOO_LOW),
        ] {
            assert_eq!(reply(&mut server, &mut shelf, request), refusal(NUMBER, code));
        }
        for (segment, code) in
            [(0x09, AbortCode::LENGTH_TOO_HIGH), (0x0D, AbortCode::LENGTH_TOO_LOW)]
        {
            reply(&mut server, &mut shelf, [0x20, 1, 0x20, 3, 0, 0, 0, 0]);
            let refused = reply(&mut server, &mut shelf, [segment, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(refused, refusal(NUMBER, code));
        }
        assert_eq!(shelf.number, [0, 0]);
    }

    #[test]
    fn a_segment_that_does_not_alternate_ends_the_transfer() {
        let (mut server, mut shelf) = (server(), Shelf { text: vec![1; 20], ..Shelf::default() });
        for (initiate, segment) in [(0x20, 0x10), (0x40, 0x70)] {
            reply(&mut server, &mut shelf, [initiate, 0, 0x20, 0, 0, 0, 0, 0]);
            let refused = reply(&mut server, &mut shelf, [segment, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(refused, refusal(TEXT, AbortCode::TOGGLE_NOT_ALTERNATED));
            let nothing = Object { index: 0, sub: 0 };
            let refused = reply(&mut server, &mut shelf, [segment, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(refused, refusal(nothing, AbortCode::COMMAND_UNKNOWN));
        }
    }

    #[test]
    fn a_new_initiate_ends_a_running_transfer() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        reply(&mut server, &mut shelf, [0x20, 0, 0x20, 0, 0, 0, 0, 0]);
        reply(&mut server, &mut shelf, [0x2B, 1, 0x20, 3, 1, 2, 0, 0]);
        let [command, ..] = reply(&mut server, &mut shelf, [0x01, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(command, 0x80, "its segment belongs to nothing");
        assert_eq!((shelf.text.len(), shelf.number), (0, [1, 2]));
    }

    #[test]
    fn an_abort_ends_a_transfer_and_is_not_answered() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        reply(&mut server, &mut shelf, [0x20, 0, 0x20, 0, 0, 0, 0, 0]);
        assert_eq!(replies(&mut server, &mut shelf, [0x80, 0, 0x20, 0, 0, 0, 4, 5]), NOTHING);
        let [command, ..] = reply(&mut server, &mut shelf, [0x01, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(command, 0x80);
    }

    const NOTHING: [SdoPayload; 0] = [];

    /// 21 bytes are three segments.
    fn shelf_of_three() -> (SdoServer, Shelf) {
        (server(), Shelf { text: (1..=21).collect(), ..Shelf::default() })
    }

    fn segment(number: u8, from: u8) -> SdoPayload {
        let [a, b, c, d, e, f, g] = [0, 1, 2, 3, 4, 5, 6].map(|place| from + place);
        [number, a, b, c, d, e, f, g]
    }

    /// Of these bytes, as `binascii.crc_hqx` of Python has it.
    const SUM: [u8; 2] = [0xF0, 0xCD];

    #[test]
    fn a_block_goes_up_as_the_standard_has_it() {
        let (mut server, mut shelf) = shelf_of_three();
        let mut say = |request| replies(&mut server, &mut shelf, request);
        assert_eq!(say([0xA4, 0, 0x20, 0, 2, 0, 0, 0]), [[0xC6, 0, 0x20, 0, 21, 0, 0, 0]]);
        let start = [0xA3, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(say(start), [segment(1, 1), segment(2, 8)]);
        assert_eq!(
            say([0xA2, 1, 2, 0, 0, 0, 0, 0]),
            [segment(1, 8), segment(0x82, 15)],
            "one lost"
        );
        assert_eq!(say([0xA2, 2, 2, 0, 0, 0, 0, 0]), [[0xC1, SUM[0], SUM[1], 0, 0, 0, 0, 0]]);
        assert_eq!(say([0xA1, 0, 0, 0, 0, 0, 0, 0]), NOTHING);
        assert_eq!(say(start)[0][0], 0x80, "it is over");
    }

    #[test]
    fn a_block_comes_down_as_the_standard_has_it() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        let opening = [0xC6, 0, 0x20, 0, 20, 0, 0, 0];
        assert_eq!(reply(&mut server, &mut shelf, opening), [0xA4, 0, 0x20, 0, 127, 0, 0, 0]);
        for (segment, said) in [
            (segment(1, 1), None),
            (segment(1, 1), None),
            (segment(0x83, 15), Some([0xA2, 1, 127, 0, 0, 0, 0, 0])),
            (segment(1, 8), None),
            (segment(0x82, 15), Some([0xA2, 2, 127, 0, 0, 0, 0, 0])),
            (segment(0x82, 15), None),
        ] {
            assert_eq!(replies(&mut server, &mut shelf, segment), Vec::from_iter(said));
        }
        let [low, high] = canopen_rs::sdo::block::crc16(&Vec::from_iter(1..=20)).to_le_bytes();
        let end = [0xC5, low, high, 0, 0, 0, 0, 0];
        assert_eq!(reply(&mut server, &mut shelf, end), [0xA1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(shelf.text, Vec::from_iter(1..=20));
    }

    #[test]
    fn a_wrong_checksum_or_size_stores_nothing() {
        let ours = canopen_rs::sdo::block::crc16(&[1, 2, 3, 4, 5, 6, 7]).to_le_bytes();
        for (opening, end, code) in [
            ([0xC6, 7], [0xC1, ours[0] ^ 1, ours[1]], AbortCode::CRC_ERROR),
            ([0xC6, 8], [0xC1, ours[0], ours[1]], AbortCode::LENGTH_TOO_LOW),
            ([0xC2, 6], [0xC1, 0, 0], AbortCode::LENGTH_TOO_HIGH),
        ] {
            let (mut server, mut shelf) = (server(), Shelf::default());
            reply(&mut server, &mut shelf, [opening[0], 0, 0x20, 0, opening[1], 0, 0, 0]);
            reply(&mut server, &mut shelf, segment(0x81, 1));
            let end = [end[0], end[1], end[2], 0, 0, 0, 0, 0];
            assert_eq!(reply(&mut server, &mut shelf, end), refusal(TEXT, code));
            assert!(shelf.text.is_empty());
        }
    }

    #[test]
    fn a_block_may_come_without_size_and_checksum() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        reply(&mut server, &mut shelf, [0xC0, 0, 0x20, 0, 0, 0, 0, 0]);
        reply(&mut server, &mut shelf, segment(0x81, 1));
        reply(&mut server, &mut shelf, [0xD1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(shelf.text, [1, 2, 3]);
    }

    #[test]
    fn a_block_without_its_size_still_has_that_of_its_object() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        reply(&mut server, &mut shelf, [0xC0, 1, 0x20, 3, 0, 0, 0, 0]);
        reply(&mut server, &mut shelf, segment(0x81, 1));
        let refused = reply(&mut server, &mut shelf, [0xD1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(refused, refusal(NUMBER, AbortCode::LENGTH_TOO_HIGH));
        assert_eq!(shelf.number, [0, 0]);
    }

    #[test]
    fn what_no_block_can_be_is_refused() {
        let (mut server, mut shelf) = shelf_of_three();
        for (requests, object, code) in [
            (vec![[0xA4, 0, 0x20, 0, 0, 0, 0, 0]], TEXT, AbortCode::BLOCK_SIZE_INVALID),
            (vec![[0xA4, 0, 0x20, 0, 128, 0, 0, 0]], TEXT, AbortCode::BLOCK_SIZE_INVALID),
            (vec![[0xC6, 0, 0x20, 0, 0, 0, 0, 2]], TEXT, AbortCode::OUT_OF_MEMORY),
            (vec![[0xC6, 1, 0x20, 3, 3, 0, 0, 0]], NUMBER, AbortCode::LENGTH_TOO_HIGH),
            (
                vec![[0xC6, 0, 0x20, 0, 9, 0, 0, 0], [0; 8]],
                TEXT,
                AbortCode::SEQUENCE_NUMBER_INVALID,
            ),
            (
                vec![[0xA4, 0, 0x20, 0, 2, 0, 0, 0], [0xA2, 1, 2, 0, 0, 0, 0, 0]],
                TEXT,
                AbortCode::COMMAND_UNKNOWN,
            ),
            (
                vec![
                    [0xA4, 0, 0x20, 0, 2, 0, 0, 0],
                    [0xA3, 0, 0, 0, 0, 0, 0, 0],
                    [0xA2, 3, 2, 0, 0, 0, 0, 0],
                ],
                TEXT,
                AbortCode::SEQUENCE_NUMBER_INVALID,
            ),
        ] {
            let said: Vec<_> = requests
                .into_iter()
                .map(|request| replies(&mut server, &mut shelf, request))
                .collect();
            assert_eq!(said.last().unwrap(), &[refusal(object, code)]);
            let [command, ..] = reply(&mut server, &mut shelf, [0x60, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(command, 0x80, "nothing is under way");
        }
    }

    #[test]
    fn a_short_value_goes_up_the_other_way_if_the_client_says_so() {
        let (mut server, mut shelf) = shelf_of_three();
        for (threshold, command) in [(20, 0xC6), (21, 0x41)] {
            let request = [0xA4, 0, 0x20, 0, 127, threshold, 0, 0];
            let said = reply(&mut server, &mut shelf, request);
            assert_eq!(said, [command, 0, 0x20, 0, 21, 0, 0, 0]);
        }
        let said = reply(&mut server, &mut shelf, [0xA0, 1, 0x20, 3, 127, 2, 0, 0]);
        assert_eq!(said, [0x4B, 1, 0x20, 3, 0, 0, 0, 0], "expedited");
    }

    #[test]
    fn a_client_that_falls_silent_frees_the_server() {
        let openings: [&[SdoPayload]; 4] = [
            &[[0x20, 0, 0x20, 0, 0, 0, 0, 0]],
            &[[0x40, 0, 0x20, 0, 0, 0, 0, 0]],
            &[[0xA4, 0, 0x20, 0, 2, 0, 0, 0], [0xA3, 0, 0, 0, 0, 0, 0, 0]],
            &[[0xC6, 0, 0x20, 0, 9, 0, 0, 0], [1, 0, 0, 0, 0, 0, 0, 0]],
        ];
        for opening in openings {
            let (mut server, mut shelf) = shelf_of_three();
            for request in opening {
                replies(&mut server, &mut shelf, *request);
            }
            let mut out = Vec::new();
            while let Some(due) = server.deadline() {
                assert!(due <= Instant::ZERO + PATIENCE);
                out.clear();
                server.on_time(due, &mut out);
            }
            assert_eq!(out, [Frame::new(0x585, refusal(TEXT, AbortCode::TIMED_OUT))]);
        }
    }

    #[test]
    fn lost_segments_are_asked_for_when_nothing_comes() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        reply(&mut server, &mut shelf, [0xC6, 0, 0x20, 0, 90, 0, 0, 0]);
        let ask = |server: &mut SdoServer| {
            let mut out = Vec::new();
            server.on_time(Instant::ZERO + NUDGE, &mut out);
            out
        };
        assert_eq!(ask(&mut server), [Frame::new(0x585, [0xA2, 0, 127, 0, 0, 0, 0, 0])]);
        assert_eq!(ask(&mut server), [], "once");
        assert_eq!(replies(&mut server, &mut shelf, segment(1, 1)), NOTHING);
        assert_eq!(replies(&mut server, &mut shelf, segment(2, 8)), NOTHING);
        assert_eq!(ask(&mut server), [Frame::new(0x585, [0xA2, 2, 127, 0, 0, 0, 0, 0])]);
    }

    proptest! {
        #[test]
        fn any_requests_are_answered_in_bounds_and_end(
            requests in proptest::collection::vec(
                (any::<[u8; 8]>(), 0_usize..16, any::<bool>(), 0_u64..400_000), 0..200,
            ),
        ) {
            let (mut server, mut shelf) = shelf_of_three();
            let (mut now, mut out) = (Instant::ZERO, Vec::new());
            let known = [
                0x20, 0x21, 0x23, 0x40, 0x60, 0x70, 0x80, 0xA0, 0xA1, 0xA2, 0xA3, 0xA4, 0xC1, 0xC6,
                0x01, 0x82,
            ];
            for (mut request, place, is_known, micros) in requests {
                if is_known {
                    request = [known[place], 0, 0x20, 0, request[4], 0, 0, 0];
                }
                now = now + Duration::from_micros(micros);
                server.on_time(now, &mut out);
                server.serve(now, request, &mut shelf, &mut out);
                prop_assert!(out.len() <= 129);
                out.clear();
            }
            for _ in 0..2 {
                server.on_time(now + PATIENCE, &mut out);
            }
            prop_assert_eq!(server.deadline(), None);
        }
    }
}
