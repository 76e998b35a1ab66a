//! Client side of a block upload (CiA 301, 7.2.4.3.13 to 7.2.4.3.16).
//!
//! ```text
//! client                                server
//! A4h index sub blksize pst ──────────►           or A0h: without CRC
//!           ◄────────── C6h index sub size        bits sc, s; or a segmented upload response
//! A3h ────────────────────────────────►
//!           ◄────────── 01h … 7Fh, 7 bytes each   bit 7 of the last
//! A2h ackseq blksize ─────────────────►           repeated until complete
//!           ◄────────── C1h | n << 2, CRC
//! A1h ────────────────────────────────►
//! ```

use canopen_rs::Address;
use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::block::{
    decode_end, decode_upload_initiate_response, encode_end_response, encode_upload_initiate,
    encode_upload_start,
};

use crate::abort::AbortCode;
use crate::sdo::command::SCS_UPLOAD;
use crate::sdo::content::{Content, Size};
use crate::sdo::options::Block;
use crate::sdo::receiver::{BlockParameters, Receiver, SegmentEffect};
use crate::sdo::step::Step;

/// Block upload in progress.
#[derive(Clone, Debug)]
pub(super) struct BlockUpload {
    about: Address,
    limit: usize,
    block: Block,
    /// Protocol switch threshold in bytes; zero always uses blocks.
    threshold: u8,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    Opening,
    Receiving(Receiver),
}

impl BlockUpload {
    /// Returns an upload of at most `limit` bytes; up to `threshold` bytes the server may switch protocols.
    pub(super) const fn new(about: Address, limit: usize, block: Block, threshold: u8) -> Self {
        Self { about, limit, block, threshold, state: State::Opening }
    }

    /// Initiating request.
    pub(super) fn request(&self) -> SdoPayload {
        let [c, low, high, sub, size, _, x, y] =
            encode_upload_initiate(self.about, self.block.size(), self.block.has_crc());
        [c, low, high, sub, size, self.threshold, x, y]
    }

    /// Takes a reply.
    pub(super) fn on_reply(&mut self, reply: &SdoPayload) -> Step {
        match &mut self.state {
            State::Opening => self.on_opened(reply).into(),
            State::Receiving(receiver) if receiver.is_complete() => on_end(receiver, reply).into(),
            State::Receiving(receiver) => on_segment(receiver, reply).into(),
        }
    }

    /// Repeats the last acknowledgement after a timeout.
    pub(super) fn retry(&mut self) -> Option<SdoPayload> {
        match &mut self.state {
            State::Opening => None,
            State::Receiving(receiver) => receiver.retry(),
        }
    }

    /// Returns whether segments are being received; any first byte but that of an abort is then valid.
    pub(super) const fn is_receiving(&self) -> bool {
        matches!(self.state, State::Receiving(_))
    }

    /// Takes the upload response: by blocks, or by the segmented protocol.
    fn on_opened(&mut self, reply: &SdoPayload) -> Result<Step, AbortCode> {
        let [command, low, high, sub, ..] = *reply;
        if Address::new(u16::from_le_bytes([low, high]), sub) != self.about {
            return Ok(Step::Pass);
        }
        if command >> 5 == SCS_UPLOAD {
            return Ok(Step::Switch);
        }
        let Ok(opened) = decode_upload_initiate_response(reply) else { return Ok(Step::Pass) };
        let declared = opened.size.map(|size| usize::try_from(size).unwrap_or(usize::MAX));
        let has_crc = self.block.has_crc() && opened.crc_support;
        let (limit, block_size) = (self.limit, self.block.size());
        let parameters = BlockParameters { declared, has_crc, limit, block_size };
        let start = encode_upload_start();
        self.state = State::Receiving(Receiver::new([*reply, start], parameters)?);
        Ok(Step::Send(start))
    }
}

fn on_segment(receiver: &mut Receiver, reply: &SdoPayload) -> Result<Step, AbortCode> {
    Ok(match receiver.take(reply)? {
        SegmentEffect::InSequence => Step::Wait,
        SegmentEffect::Ignored => Step::Pass,
        SegmentEffect::EndOfBlock if receiver.has_received() => Step::Send(receiver.answer()),
        SegmentEffect::EndOfBlock => Step::Repeat(receiver.answer()),
    })
}

fn on_end(receiver: &mut Receiver, reply: &SdoPayload) -> Result<Step, AbortCode> {
    let Ok((unused, sum)) = decode_end(reply) else { return Ok(Step::Pass) };
    if receiver.is_again(reply) {
        return Ok(Step::Pass);
    }
    let bytes = receiver.finish(unused, sum)?;
    let size = if receiver.is_declared() { Size::Indicated } else { Size::Counted };
    Ok(Step::Confirm(encode_end_response(), Content::new(bytes, size)))
}
