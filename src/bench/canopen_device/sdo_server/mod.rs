//! Default SDO server (CiA 301, 7.2.4.3): expedited, segmented and block transfers in both directions, with and
//! without an indicated size.
//!
//! One transfer at a time: a new initiation ends the one before, and so does a silent client. [`Access`]
//! connects the objects. During a block download every frame but an abort is a segment.

mod block;
mod opening;
mod segmented;
mod size;
#[cfg(test)]
mod tests;

use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::sdo::{SdoPayload, request_cob_id, response_cob_id};

use crate::sdo_server::block::{CONFIRMED, Next, SIZE_INDICATED_IN_BLOCK};
use crate::station::earlier;
use canopen::abort::AbortCode;
use canopen::frame::Frame;
use canopen::object::Object;
use canopen::sdo::Receiver;
use units::time::Instant;

/// Time allowed between two requests of a transfer. A client must receive a sub-block in it, which takes 1.7 s
/// at 10 kbit/s.
const CLIENT_TIMEOUT: Duration = Duration::from_secs(3);

/// Time after which lost segments of a block download are requested again.
const RETRY_TIMEOUT: Duration = Duration::from_millis(500);

/// Interval between two segments of a block upload: their time at 1 Mbit/s without stuff bits. So a sub-block fills the
/// bus and not the transmit queue.
const SEGMENT_INTERVAL: Duration = Duration::from_micros(100);

/// Objects of a server.
pub(super) trait Access {
    /// Appends the value of an object to `bytes`, which is empty.
    fn read(&self, object: Object, bytes: &mut Vec<u8>) -> Result<(), AbortCode>;

    /// Size of an object that may be written now; `None` for any size.
    fn size(&self, object: Object) -> Result<Option<usize>, AbortCode>;

    /// Writes an object and applies its effect. `bytes` have the required size.
    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode>;

    /// Returns whether upload responses indicate the size, as they should.
    fn indicates_size(&self) -> bool {
        true
    }

    /// Abort code sent for a refusal.
    fn reason(&self, code: AbortCode) -> AbortCode {
        code
    }
}

/// SDO server of one device.
#[derive(Clone, Debug)]
pub(super) struct SdoServer {
    node: NodeId,
    transfer: Option<Transfer>,
    /// Time of the last request.
    last_request: Instant,
    has_retried: bool,
    /// Time of the next block segment.
    due: Option<Instant>,
    /// Buffer for short values; kept to avoid allocation.
    spare: Vec<u8>,
}

/// Transfer in progress.
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
    BlockDown(Receiver),
}

/// Reply, if any, or the object and code of an abort.
type Reply = Result<Option<SdoPayload>, (Object, AbortCode)>;

impl SdoServer {
    /// Returns an idle server with the default COB-IDs of `node`.
    pub(super) const fn new(node: NodeId) -> Self {
        Self {
            node,
            transfer: None,
            last_request: Instant::ZERO,
            has_retried: false,
            due: None,
            spare: Vec::new(),
        }
    }

    /// Discards the transfer in progress.
    pub(super) fn reset(&mut self) {
        self.transfer = None;
        self.due = None;
    }

    /// COB-ID of requests.
    pub(super) const fn cob_id(&self) -> u16 {
        request_cob_id(self.node)
    }

    /// Returns the request in a frame; `None` unless it has eight bytes and addresses this server.
    pub(super) fn request(&self, frame: &Frame) -> Option<SdoPayload> {
        let is_ours = frame.cob_id == self.cob_id();
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
        self.last_request = now;
        self.has_retried = false;
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

    /// Sends the segment that is due, requests lost ones, or aborts the transfer of a silent client.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if self.due.is_some_and(|due| due <= now) {
            self.send_segment(now, out);
        }
        if self.client_deadline().is_none_or(|due| now < due) {
            return;
        }
        let Some(Transfer { object, way }) = &mut self.transfer else { return };
        let (object, is_over) = (*object, now >= self.last_request + CLIENT_TIMEOUT);
        let payload = match way {
            Way::BlockDown(download) if !is_over => download.retry(),
            Way::Up(_) | Way::Down(_) | Way::BlockUp(_) | Way::BlockDown(_) => {
                Some(abort(object, AbortCode::TIMED_OUT))
            }
        };
        self.has_retried = true;
        if is_over {
            self.reset();
        }
        out.extend(payload.map(|payload| self.frame(payload)));
    }

    /// Time of the next call of [`on_time`](Self::on_time).
    pub(super) fn deadline(&self) -> Option<Instant> {
        earlier(self.due, self.client_deadline())
    }

    /// Time of the next retry or abort of a silent client.
    fn client_deadline(&self) -> Option<Instant> {
        let may_retry = match &self.transfer.as_ref()?.way {
            Way::BlockDown(_) => !self.has_retried,
            Way::Up(_) | Way::Down(_) | Way::BlockUp(_) => false,
        };
        Some(self.last_request + if may_retry { RETRY_TIMEOUT } else { CLIENT_TIMEOUT })
    }

    /// Takes a request as a block segment, if segments are expected and it is no abort.
    fn on_block_segment(&mut self, request: &SdoPayload) -> Option<Reply> {
        let Transfer { object, way: Way::BlockDown(download) } = self.transfer.as_mut()? else {
            return None;
        };
        let ([command, ..], object) = (*request, *object);
        if download.is_complete() {
            return download.is_again(request).then_some(Ok(None));
        }
        let is_segment = command != CS_ABORT << 5;
        is_segment.then(|| block::on_segment(download, request).map_err(|code| (object, code)))
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

    /// Takes a request within a transfer.
    fn on_request(&mut self, request: SdoPayload, objects: &mut impl Access) -> Reply {
        let [command, low, high, sub, ..] = request;
        let specifier = command >> 5;
        let Some(Transfer { object, way }) = &mut self.transfer else {
            // A stray segment names no object; an unknown command may.
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
                let sum = u16::from_le_bytes([low, high]);
                let bytes = download.finish(command >> 2 & 7, sum).map_err(refused)?;
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

    /// Sends the next segment of the current sub-block, if there is one.
    fn send_segment(&mut self, now: Instant, out: &mut Vec<Frame>) {
        self.due = None;
        if let Some(Transfer { way: Way::BlockUp(upload), .. }) = &mut self.transfer
            && let Some(segment) = upload.next()
        {
            out.push(Frame::new(response_cob_id(self.node), segment));
            self.due = upload.has_next().then_some(now + SEGMENT_INTERVAL);
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

// Command specifiers of client and server: the three highest bits.
const CCS_DOWNLOAD_SEGMENT: u8 = 0;
const CCS_DOWNLOAD: u8 = 1;
const CCS_UPLOAD: u8 = 2;
const CCS_UPLOAD_SEGMENT: u8 = 3;
const CS_ABORT: u8 = 4;
const CCS_BLOCK_UPLOAD: u8 = 5;
const CCS_BLOCK_DOWNLOAD: u8 = 6;
const CS_RESERVED: u8 = 7;
/// Subcommand bits of a block transfer.
const SUBCOMMAND: u8 = 3;
