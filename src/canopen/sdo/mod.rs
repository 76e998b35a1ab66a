//! SDO client transfers (CiA 301, 7.2.4.3): expedited, segmented and block transfer, in both directions.
//!
//! A reply counts only if it comes from the requested node and names the requested object. All other frames are ignored,
//! including late replies and stale aborts; the deadline of the request ends the wait. Segments name no object, but a
//! server replies in order, so old ones cannot follow once the transfer is initiated.
//!
//! Each call appends at most one frame, and `on_time` alone sends the segments of a block: the caller limits
//! the bus load by its calls. Segments that a server loses are sent again.
//!
//! ```
//! use std::time::Duration;
//!
//! use canopen::NodeId;
//! use canopen::frame::Frame;
//! use canopen::object::Object;
//! use canopen::sdo::Transfer;
//! use units::time::Instant;
//!
//! let (now, mut out) = (Instant::ZERO, Vec::new());
//! let timeout = Duration::from_millis(500);
//! let mut transfer =
//!     Transfer::read(NodeId::new(5).unwrap(), Object::DEVICE_TYPE, timeout, now, &mut out);
//! assert_eq!(out, [Frame::new(0x605, [0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0])]);
//!
//! let reply = Frame::new(0x585, [0x43, 0x00, 0x10, 0x00, 0x92, 0x01, 0x02, 0x00]);
//! let content = transfer.on_frame(now, &reply, &mut out).unwrap().unwrap();
//! assert_eq!(content.bytes(), [0x92, 0x01, 0x02, 0x00]);
//! ```

mod block_download;
mod block_upload;
pub(crate) mod command;
mod content;
mod crc;
mod options;
mod receiver;
mod segmented;
mod sender;
mod step;
#[cfg(test)]
mod tests;
mod transfer;

pub use content::{Content, bytes};
pub use options::{Block, InvalidBlockSize, MAX_BYTES, Protocol, SEGMENTED_BYTES, SdoOptions};
pub use receiver::{BlockParameters, Receiver, SegmentEffect};
pub use sender::Sender;
pub use transfer::Transfer;

use thiserror::Error;

use crate::abort::AbortCode;

/// Failure of a transfer, and the side that aborted it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SdoError {
    /// Abort by the server, with the reason that it sent.
    #[error("refused: {0}")]
    AbortedByServer(AbortCode),
    /// Abort by this client, with the reason sent to the server.
    #[error("aborted by the client: {0}")]
    AbortedLocally(AbortCode),
    /// No reply in time, after which this client aborted the transfer.
    #[error("no answer")]
    Timeout,
}

/// Outcome of a transfer: the content read, or no content after a write.
pub type Outcome = Result<Content, SdoError>;
