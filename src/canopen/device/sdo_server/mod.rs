//! The default SDO server (CiA 301, 7.2.4.3): expedited, segmented and by blocks, up and down, with and
//! without a declared size.
//!
//! One transfer at a time; whatever opens one ends the one before, and so does a client that falls
//! silent. Whether an object may be read or written, and what follows, is told by [`Access`]. While the
//! segments of a block come, every frame but an abort is one of them: their first byte is a number.

mod block;
mod opening;
mod segmented;
mod size;
#[cfg(test)]
mod tests;

use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::request_cob_id;
use canopen_rs::sdo::response_cob_id;

use crate::abort::AbortCode;
use crate::device::sdo_server::block::CONFIRMED;
use crate::device::sdo_server::block::Next;
use crate::device::sdo_server::opening::SIZE_INDICATED_IN_BLOCK;
use crate::frame::Frame;
use crate::object::Object;
use units::time::Instant;

/// How long a client may be silent in the middle of a transfer. It must hear a sub-block first, which
/// takes 1.7 s at 10 kbit/s.
const PATIENCE: Duration = Duration::from_secs(3);

/// After how much of that the segments of a block that were lost are asked for.
const NUDGE: Duration = Duration::from_millis(500);

/// Between two segments of an upload by blocks: what one takes at 1 Mbit/s without its stuffing, so that a
/// sub-block fills the bus and not the queue before it.
const PACE: Duration = Duration::from_micros(100);

/// The objects, as a server sees them.
pub(super) trait Access {
    /// Puts what an object holds into `bytes`, which is empty.
    fn read(&self, object: Object, bytes: &mut Vec<u8>) -> Result<(), AbortCode>;

    /// The size of an object that may be written now, `None` where it may be any.
    fn size(&self, object: Object) -> Result<Option<usize>, AbortCode>;

    /// Writes, and does what follows from it. `bytes` have the size told.
    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode>;

    /// Whether replies say how many bytes they hold, as they should.
    fn tells_sizes(&self) -> bool {
        true
    }

    /// What is given as the reason of a refusal.
    fn reason(&self, code: AbortCode) -> AbortCode {
        code
    }
}

/// The server of one device.
#[derive(Clone, Debug)]
pub(super) struct SdoServer {
    node: NodeId,
    transfer: Option<Transfer>,
    /// When the client was heard last.
    heard: Instant,
    has_nudged: bool,
    /// When the next segment of a block goes out.
    due: Option<Instant>,
    /// Where the next short value is read; kept, so that reading one allocates nothing.
    spare: Vec<u8>,
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
        Self {
            node,
            transfer: None,
            heard: Instant::ZERO,
            has_nudged: false,
            due: None,
            spare: Vec::new(),
        }
    }

    /// Forgets the transfer under way.
    pub(super) fn reset(&mut self) {
        self.transfer = None;
        self.due = None;
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
                out.push(self.frame(abort(object, objects.reason(code))));
            }
        }
        self.send_segment(now, out);
    }

    /// Sends the segment that is due, asks for what was lost, or ends a transfer whose client has fallen silent.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if self.due.is_some_and(|due| due <= now) {
            self.send_segment(now, out);
        }
        if self.silence_ends().is_none_or(|due| now < due) {
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
            self.reset();
        }
        out.extend(payload.map(|payload| self.frame(payload)));
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.due.into_iter().chain(self.silence_ends()).min()
    }

    /// When a client will have been silent for too long.
    fn silence_ends(&self) -> Option<Instant> {
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
        let [command, low, high, sub, ..] = request;
        let specifier = command >> 5;
        let Some(Transfer { object, way }) = &mut self.transfer else {
            // A segment that nothing has opened names no object; a command nobody knows may.
            let named = if specifier == CS_RESERVED { [low, high, sub] } else { [0; 3] };
            let [low, high, sub] = named;
            let object = Object { index: u16::from_le_bytes([low, high]), sub };
            return Err((object, AbortCode::COMMAND_UNKNOWN));
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

    /// Sends the next segment of the sub-block under way, if there is one.
    fn send_segment(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.due = None;
        if let Some(Transfer { way: Way::BlockUp(upload), .. }) = &mut self.transfer
            && let Some(segment) = upload.next()
        {
            out.push(Frame::new(response_cob_id(self.node), segment));
            self.due = upload.has_next().then_some(now + PACE);
        }
    }

    fn frame(&self, payload: SdoPayload) -> Frame {
        Frame::new(response_cob_id(self.node), payload)
    }
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
const CS_RESERVED: u8 = 7;
/// What a frame of a block transfer is.
const SUBCOMMAND: u8 = 3;
