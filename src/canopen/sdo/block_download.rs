//! Client side of a block download (CiA 301, 7.2.4.3.9 to 7.2.4.3.12).
//!
//! ```text
//! client                                server
//! C6h index sub size ─────────────────►           or C2h: without CRC
//!           ◄────────── A4h index sub blksize     bit sc
//! 01h … 7Fh, 7 bytes each ────────────►           bit 7 of the last
//!           ◄────────── A2h ackseq blksize        repeated until complete
//! C1h | n << 2, CRC ──────────────────►
//!           ◄────────── A1h
//! ```

use canopen_rs::Address;
use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::block::{
    decode_download_initiate_response, decode_end_response, decode_sub_response,
    encode_download_initiate, encode_end,
};

use crate::sdo::content::Content;
use crate::sdo::options::Block;
use crate::sdo::sender::Sender;
use crate::sdo::step::Step;

/// Block download in progress.
#[derive(Clone, Debug)]
pub(super) struct BlockDownload {
    about: Address,
    block: Block,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    Opening { bytes: Vec<u8> },
    Sending { sender: Sender, has_crc: bool },
    Ending { end: SdoPayload },
}

impl BlockDownload {
    /// Returns a download that has sent nothing yet.
    pub(super) const fn new(about: Address, bytes: Vec<u8>, block: Block) -> Self {
        Self { about, block, state: State::Opening { bytes } }
    }

    /// Initiating request.
    pub(super) fn request(&self) -> SdoPayload {
        let size = match &self.state {
            State::Opening { bytes } => u32::try_from(bytes.len()).ok(),
            State::Sending { .. } | State::Ending { .. } => None,
        };
        encode_download_initiate(self.about, size, self.block.has_crc())
    }

    /// Takes a reply.
    pub(super) fn on_reply(&mut self, reply: &SdoPayload) -> Step {
        match &mut self.state {
            State::Opening { bytes } => {
                let Ok(opened) = decode_download_initiate_response(reply) else {
                    return Step::Pass;
                };
                if opened.address != self.about {
                    return Step::Pass;
                }
                match Sender::new(std::mem::take(bytes), opened.blksize) {
                    Ok(sender) => {
                        let has_crc = self.block.has_crc() && opened.crc_support;
                        self.state = State::Sending { sender, has_crc };
                        Step::Stream
                    }
                    Err(code) => Step::Abort(code),
                }
            }
            State::Sending { sender, has_crc } => {
                let Ok((arrived, block_size)) = decode_sub_response(reply) else {
                    return Step::Pass;
                };
                match sender.answered(arrived, block_size) {
                    Ok(true) => {
                        let sum = if *has_crc { sender.sum() } else { 0 };
                        let end = encode_end(sender.unused(), sum);
                        self.state = State::Ending { end };
                        Step::Send(end)
                    }
                    Ok(false) => Step::Stream,
                    Err(code) => Step::Abort(code),
                }
            }
            State::Ending { end } => {
                if decode_end_response(reply).is_ok() {
                    return Step::Done(Content::default());
                }
                // The last sub-block is acknowledged again: the end request was lost.
                if decode_sub_response(reply).is_ok() { Step::Repeat(*end) } else { Step::Pass }
            }
        }
    }

    /// Returns the next segment to send.
    pub(super) fn next(&mut self) -> Option<SdoPayload> {
        match &mut self.state {
            State::Sending { sender, .. } => sender.next_segment(),
            State::Opening { .. } | State::Ending { .. } => None,
        }
    }

    /// Returns whether [`next`](Self::next) has a segment.
    pub(super) const fn has_next(&self) -> bool {
        match &self.state {
            State::Sending { sender, .. } => sender.has_next(),
            State::Opening { .. } | State::Ending { .. } => false,
        }
    }

    /// Returns the value if no byte was sent yet.
    pub(super) fn unsent(&mut self) -> Option<Vec<u8>> {
        match &mut self.state {
            State::Opening { bytes } => Some(std::mem::take(bytes)),
            State::Sending { .. } | State::Ending { .. } => None,
        }
    }
}
