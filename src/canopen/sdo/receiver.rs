//! Receiver of a block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.16): the client of an upload or the server of a
//! download.
//!
//! Accepts segments in sequence only. Each sub-block is acknowledged at its end. Memory grows with received
//! bytes, not with the indicated size.

use canopen_rs::sdo::block::encode_sub_response;
use canopen_rs::sdo::{SEGMENT_DATA_MAX, SdoPayload};

use crate::abort::AbortCode;
use crate::sdo::crc::Crc;
use crate::sdo::sender::LAST;

/// Consequence of a segment for the sub-block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentEffect {
    /// Next segment in sequence; more follow.
    InSequence,
    /// Out of sequence: segments were lost, or it is a repetition. More follow.
    Ignored,
    /// End of a sub-block: [acknowledge](Receiver::answer) it.
    EndOfBlock,
}

/// Parameters of a block transfer.
#[derive(Clone, Copy, Debug)]
pub struct BlockParameters {
    /// Indicated size, in bytes.
    pub declared: Option<usize>,
    /// Set if a CRC follows at the end.
    pub has_crc: bool,
    /// Maximum size, in bytes.
    pub limit: usize,
    /// Segments per sub-block.
    pub block_size: u8,
}

/// Value in transfer, and its progress.
#[derive(Clone, Debug)]
pub struct Receiver {
    bytes: Vec<u8>,
    /// CRC of the first `summed` bytes.
    crc: Crc,
    summed: usize,
    /// Indicated size, in bytes.
    declared: Option<usize>,
    limit: usize,
    /// Segments per sub-block.
    block_size: u8,
    /// Segments of the current sub-block received in sequence.
    arrived: u8,
    /// Last accepted frame, to recognise its repetition.
    last: SdoPayload,
    /// Last reply of this side.
    reply: SdoPayload,
    /// Set if a CRC follows at the end.
    has_crc: bool,
    is_complete: bool,
}

impl Receiver {
    /// Returns a receiver after the frame `opening`, to which this side replied `reply`.
    ///
    /// # Errors
    /// Returns an abort code if the indicated size exceeds `limit`.
    pub fn new(
        [opening, reply]: [SdoPayload; 2],
        BlockParameters { declared, has_crc, limit, block_size }: BlockParameters,
    ) -> Result<Self, AbortCode> {
        if declared.is_some_and(|declared| declared > limit) {
            return Err(AbortCode::OUT_OF_MEMORY);
        }
        Ok(Self {
            bytes: Vec::new(),
            crc: Crc::default(),
            summed: 0,
            declared,
            limit,
            block_size,
            arrived: 0,
            last: opening,
            reply,
            has_crc,
            is_complete: false,
        })
    }

    /// Takes a segment.
    ///
    /// # Errors
    /// Returns an abort code for an invalid sequence number, or for more bytes than indicated.
    pub fn take(&mut self, segment: &SdoPayload) -> Result<SegmentEffect, AbortCode> {
        let &[command, ref seven @ ..] = segment;
        let (number, is_last) = (command & !LAST, command & LAST != 0);
        let is_end = is_last || number == self.block_size;
        if number == self.arrived + 1 && !self.is_complete {
            self.bytes.extend_from_slice(seven);
            self.last = *segment;
            self.arrived = number;
            self.is_complete = is_last;
            self.check_room()?;
            return Ok(if is_end { SegmentEffect::EndOfBlock } else { SegmentEffect::InSequence });
        }
        if *segment == self.last {
            return Ok(SegmentEffect::Ignored);
        }
        if number == 0 || number > self.block_size {
            return Err(AbortCode::SEQUENCE_NUMBER_INVALID);
        }
        Ok(if is_end { SegmentEffect::EndOfBlock } else { SegmentEffect::Ignored })
    }

    /// Acknowledges the segments of this sub-block that arrived in sequence; the next starts after them.
    pub fn answer(&mut self) -> SdoPayload {
        let unknown = if self.is_complete { SEGMENT_DATA_MAX } else { 0 };
        let end = self.bytes.len().saturating_sub(unknown);
        self.crc.take(self.bytes.get(self.summed..end).unwrap_or_default());
        self.summed = end;
        self.reply = encode_sub_response(std::mem::take(&mut self.arrived), self.block_size);
        self.reply
    }

    /// Returns the acknowledgement, or the last reply, to send after a timeout. The last reply may look like
    /// an acknowledgement of a lost sub-block, so it is repeated only if a size or CRC would reveal that.
    pub fn retry(&mut self) -> Option<SdoPayload> {
        if self.has_received() {
            return Some(self.answer());
        }
        let is_safe = self.has_crc || self.declared.is_some();
        is_safe.then_some(self.reply)
    }

    /// Returns whether a segment of this sub-block was received.
    pub const fn has_received(&self) -> bool {
        self.arrived > 0
    }

    /// Returns whether the last segment was received.
    pub const fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Returns whether the size was indicated.
    pub const fn is_declared(&self) -> bool {
        self.declared.is_some()
    }

    /// Returns whether `frame` repeats the last accepted one.
    pub fn is_again(&self, frame: &SdoPayload) -> bool {
        *frame == self.last
    }

    /// Returns the value without the `unused` bytes of its last segment.
    ///
    /// # Errors
    /// Returns an abort code if the CRC differs from `sum`, or the size from the indicated one.
    pub fn finish(&mut self, unused: u8, sum: u16) -> Result<Vec<u8>, AbortCode> {
        self.bytes.truncate(self.bytes.len().saturating_sub(usize::from(unused)));
        let rest = self.bytes.get(self.summed..).ok_or(AbortCode::COMMAND_UNKNOWN)?;
        self.crc.take(rest);
        if self.has_crc && sum != self.crc.sum() {
            return Err(AbortCode::CRC_ERROR);
        }
        match self.declared {
            Some(declared) if self.bytes.len() > declared => Err(AbortCode::LENGTH_TOO_HIGH),
            Some(declared) if self.bytes.len() < declared => Err(AbortCode::LENGTH_TOO_LOW),
            None if self.bytes.len() > self.limit => Err(AbortCode::OUT_OF_MEMORY),
            Some(_) | None => Ok(std::mem::take(&mut self.bytes)),
        }
    }

    /// Checks the size, except for bytes of a last segment that may be unused.
    fn check_room(&self) -> Result<(), AbortCode> {
        let certain = self.bytes.len().saturating_sub(SEGMENT_DATA_MAX);
        match self.declared {
            Some(declared) if certain > declared => Err(AbortCode::LENGTH_TOO_HIGH),
            None if certain > self.limit => Err(AbortCode::OUT_OF_MEMORY),
            Some(_) | None => Ok(()),
        }
    }
}
