//! The default SDO server (CiA 301, 7.2.4.3): expedited and segmented, up and down, with and without
//! a declared size.
//!
//! One transfer at a time; whatever opens one ends the one before. Whether an object may be read or
//! written, and what follows, is told by [`Access`]. No block transfer.

use canopen_rs::NodeId;
use canopen_rs::sdo::request_cob_id;
use canopen_rs::sdo::response_cob_id;

use crate::canopen::abort::AbortCode;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::canopen::sdo::MAX_BYTES;

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
    /// What is transferred; kept, so that nothing is allocated later.
    bytes: Vec<u8>,
}

/// A segmented transfer under way.
#[derive(Clone, Copy, Debug)]
struct Transfer {
    object: Object,
    way: Way,
    /// Toggle bit of the next segment.
    toggle: bool,
}

#[derive(Clone, Copy, Debug)]
enum Way {
    Up { sent: usize },
    Down { size: Option<usize> },
}

/// A command byte and the seven bytes that follow it.
type Payload = [u8; 8];

impl SdoServer {
    /// The server of `node`.
    pub(super) const fn new(node: NodeId) -> Self {
        Self { node, transfer: None, bytes: Vec::new() }
    }

    /// Forgets the transfer under way.
    pub(super) const fn reset(&mut self) {
        self.transfer = None;
    }

    /// The request in a frame, `None` if there is none of eight bytes for this server.
    pub(super) fn request(&self, frame: &Frame) -> Option<Payload> {
        let is_ours = frame.cob_id == request_cob_id(self.node);
        if is_ours { frame.data().try_into().ok() } else { None }
    }

    /// Serves one request.
    pub(super) fn serve(&mut self, request: Payload, objects: &mut impl Access) -> Option<Frame> {
        let [command, low, high, sub, ..] = request;
        let object = Object { index: u16::from_le_bytes([low, high]), sub };
        let reply = match command >> 5 {
            CCS_DOWNLOAD_SEGMENT => self.on_download_segment(request, objects),
            CCS_DOWNLOAD => self.on_download(object, request, objects),
            CCS_UPLOAD => self.on_upload(object, objects),
            CCS_UPLOAD_SEGMENT => self.on_upload_segment(command),
            CS_ABORT => {
                self.transfer = None;
                return None;
            }
            _ => Err((object, AbortCode::COMMAND_UNKNOWN)),
        };
        let payload = reply.unwrap_or_else(|(object, code)| {
            self.transfer = None;
            abort(object, code)
        });
        Some(Frame::new(response_cob_id(self.node), payload))
    }

    /// A write begins, and with four bytes or fewer ends.
    fn on_download(
        &mut self,
        object: Object,
        [command, low, high, sub, four @ ..]: Payload,
        objects: &mut impl Access,
    ) -> Result<Payload, (Object, AbortCode)> {
        self.transfer = None;
        let refused = |code| (object, code);
        let size = objects.size(object).map_err(refused)?;
        let is_sized = command & SIZE_INDICATED != 0;
        if command & EXPEDITED != 0 {
            let told = is_sized.then_some(4 - usize::from(command >> 2 & 3));
            let taken = told.or(size).unwrap_or(4).min(4);
            let bytes = four.get(..taken).unwrap_or(&four);
            check_size(size, bytes.len()).map_err(refused)?;
            objects.write(object, bytes).map_err(refused)?;
        } else {
            let declared = usize::try_from(u32::from_le_bytes(four)).unwrap_or(usize::MAX);
            if is_sized {
                check_size(size, declared).map_err(refused)?;
            }
            let size = if is_sized { Some(declared) } else { size };
            self.transfer = Some(Transfer { object, way: Way::Down { size }, toggle: false });
            self.bytes.clear();
        }
        Ok([SCS_DOWNLOAD << 5, low, high, sub, 0, 0, 0, 0])
    }

    /// A piece of a longer write, which the last one ends.
    fn on_download_segment(
        &mut self,
        [command, seven @ ..]: Payload,
        objects: &mut impl Access,
    ) -> Result<Payload, (Object, AbortCode)> {
        let Some(Transfer { object, way: Way::Down { size }, toggle }) = self.transfer else {
            return Err(self.out_of_order());
        };
        let refused = |code| (object, code);
        if (command & TOGGLE != 0) != toggle {
            return Err(refused(AbortCode::TOGGLE_NOT_ALTERNATED));
        }
        let used = 7_usize.saturating_sub(usize::from(command >> 1 & 7));
        self.bytes.extend_from_slice(seven.get(..used).unwrap_or_default());
        if self.bytes.len() > size.unwrap_or(MAX_BYTES) {
            let code = size.map_or(AbortCode::OUT_OF_MEMORY, |_| AbortCode::LENGTH_TOO_HIGH);
            return Err(refused(code));
        }
        if command & LAST == 0 {
            self.transfer = Some(Transfer { object, way: Way::Down { size }, toggle: !toggle });
        } else {
            self.transfer = None;
            check_size(size, self.bytes.len()).map_err(refused)?;
            objects.write(object, &self.bytes).map_err(refused)?;
        }
        Ok([SCS_DOWNLOAD_SEGMENT << 5 | command & TOGGLE, 0, 0, 0, 0, 0, 0, 0])
    }

    /// A read begins, and with one to four bytes ends.
    fn on_upload(
        &mut self,
        object: Object,
        objects: &impl Access,
    ) -> Result<Payload, (Object, AbortCode)> {
        self.transfer = None;
        self.bytes.clear();
        objects.read(object, &mut self.bytes).map_err(|code| (object, code))?;
        let [low, high] = object.index.to_le_bytes();
        let [a, b, c, d] = match self.bytes.as_slice() {
            &[a] => [a, 0, 0, 0],
            &[a, b] => [a, b, 0, 0],
            &[a, b, c] => [a, b, c, 0],
            &[a, b, c, d] => [a, b, c, d],
            longer => u32::try_from(longer.len()).unwrap_or(u32::MAX).to_le_bytes(),
        };
        let unused = match self.bytes.len() {
            1 => 3,
            2 => 2,
            3 => 1,
            4 => 0,
            _ => {
                self.transfer = Some(Transfer { object, way: Way::Up { sent: 0 }, toggle: false });
                return Ok([SCS_UPLOAD << 5 | SIZE_INDICATED, low, high, object.sub, a, b, c, d]);
            }
        };
        let command = SCS_UPLOAD << 5 | unused << 2 | EXPEDITED | SIZE_INDICATED;
        Ok([command, low, high, object.sub, a, b, c, d])
    }

    /// A piece of a longer read, of which the last is marked.
    fn on_upload_segment(&mut self, command: u8) -> Result<Payload, (Object, AbortCode)> {
        let Some(Transfer { object, way: Way::Up { sent }, toggle }) = self.transfer else {
            return Err(self.out_of_order());
        };
        if (command & TOGGLE != 0) != toggle {
            return Err((object, AbortCode::TOGGLE_NOT_ALTERNATED));
        }
        let rest = self.bytes.get(sent..).unwrap_or_default();
        let mut payload = [0; 8];
        let mut unused = 7;
        for (to, from) in payload.iter_mut().skip(1).zip(rest) {
            *to = *from;
            unused -= 1;
        }
        let is_last = rest.len() <= 7;
        let way = Way::Up { sent: sent + 7 };
        self.transfer = (!is_last).then_some(Transfer { object, way, toggle: !toggle });
        let [first, ..] = &mut payload;
        *first = SCS_UPLOAD_SEGMENT << 5 | command & TOGGLE | unused << 1 | u8::from(is_last);
        Ok(payload)
    }

    /// A segment that nothing has opened; it names no object but that of the transfer under way.
    fn out_of_order(&self) -> (Object, AbortCode) {
        let nothing = Object { index: 0, sub: 0 };
        let object = self.transfer.map_or(nothing, |transfer| transfer.object);
        (object, AbortCode::COMMAND_UNKNOWN)
    }
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

fn abort(object: Object, code: AbortCode) -> Payload {
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
const SCS_UPLOAD_SEGMENT: u8 = 0;
const SCS_DOWNLOAD_SEGMENT: u8 = 1;
const SCS_UPLOAD: u8 = 2;
const SCS_DOWNLOAD: u8 = 3;

/// Bit t of a segment: it alternates.
const TOGGLE: u8 = 1 << 4;
/// Bit e: the value is in this frame.
const EXPEDITED: u8 = 1 << 1;
/// Bit s: how long it is, is said.
const SIZE_INDICATED: u8 = 1;
/// Bit c of a segment: no more come.
const LAST: u8 = 1;

#[cfg(test)]
mod tests {
    use super::*;

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

    fn reply(server: &mut SdoServer, shelf: &mut Shelf, request: Payload) -> Payload {
        let frame = server.serve(request, shelf).unwrap();
        assert_eq!(frame.cob_id, 0x585);
        frame.data().try_into().unwrap()
    }

    fn refusal(object: Object, code: AbortCode) -> Payload {
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
        assert_eq!(server.serve([0x80, 0, 0x20, 0, 0, 0, 4, 5], &mut shelf), None);
        let [command, ..] = reply(&mut server, &mut shelf, [0x01, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(command, 0x80);
    }

    #[test]
    fn block_transfer_is_a_command_it_does_not_know() {
        let (mut server, mut shelf) = (server(), Shelf::default());
        for command in [0xA4, 0xC6] {
            let refused = reply(&mut server, &mut shelf, [command, 0, 0x20, 0, 0, 0, 0, 0]);
            assert_eq!(refused, refusal(TEXT, AbortCode::COMMAND_UNKNOWN));
        }
    }
}
