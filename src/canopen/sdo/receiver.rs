//! A value that arrives in sub-blocks (CiA 301, 7.2.4.3.9 to 7.2.4.3.16): the side that receives, be it
//! the client of an upload or the server of a download.
//!
//! Takes segments in sequence and no others. An answer is due at the end of a sub-block, lost segments
//! or not. It grows by what arrives, never by what is merely announced.

use canopen_rs::sdo::SEGMENT_DATA_MAX;
use canopen_rs::sdo::SdoPayload;
use canopen_rs::sdo::block::encode_sub_response;

use crate::abort::AbortCode;
use crate::sdo::crc::Crc;
use crate::sdo::sender::LAST;

/// What a segment is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Taken {
    /// The next one; more follow.
    InSequence,
    /// Not the next one: others were lost, or it came twice. More follow.
    Passed,
    /// The end of a sub-block; now [answer](Receiver::answer).
    EndOfBlock,
}

/// What has been agreed on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Promise {
    /// The size that was announced, in bytes.
    pub(crate) declared: Option<usize>,
    /// Whether a checksum comes at the end.
    pub(crate) has_crc: bool,
    /// The most that may come, in bytes.
    pub(crate) limit: usize,
    /// Segments a sub-block has.
    pub(crate) block_size: u8,
}

/// A value, as far as it has come.
#[derive(Clone, Debug)]
pub(crate) struct Receiver {
    bytes: Vec<u8>,
    /// Of the first `summed` bytes.
    crc: Crc,
    summed: usize,
    /// The size that was announced.
    declared: Option<usize>,
    limit: usize,
    /// Segments a sub-block has.
    block_size: u8,
    /// Segments of this sub-block that came in sequence.
    arrived: u8,
    /// The last frame that counted: what equals it is the same again.
    last: SdoPayload,
    /// What this side said last.
    said: SdoPayload,
    /// Whether a checksum comes at the end.
    has_crc: bool,
    is_complete: bool,
}

impl Receiver {
    /// Nothing has come yet but `opening`, the frame that said it would; of this side, `said`.
    ///
    /// # Errors
    /// When more is announced than `limit` bytes.
    pub(crate) fn new(
        [opening, said]: [SdoPayload; 2],
        Promise { declared, has_crc, limit, block_size }: Promise,
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
            said,
            has_crc,
            is_complete: false,
        })
    }

    /// Takes a segment.
    ///
    /// # Errors
    /// When its number is none, or it is more than may come.
    pub(crate) fn take(&mut self, segment: &SdoPayload) -> Result<Taken, AbortCode> {
        let &[command, ref seven @ ..] = segment;
        let (number, is_last) = (command & !LAST, command & LAST != 0);
        let is_end = is_last || number == self.block_size;
        if number == self.arrived + 1 && !self.is_complete {
            self.bytes.extend_from_slice(seven);
            self.last = *segment;
            self.arrived = number;
            self.is_complete = is_last;
            self.check_room()?;
            return Ok(if is_end { Taken::EndOfBlock } else { Taken::InSequence });
        }
        if *segment == self.last {
            return Ok(Taken::Passed);
        }
        if number == 0 || number > self.block_size {
            return Err(AbortCode::SEQUENCE_NUMBER_INVALID);
        }
        Ok(if is_end { Taken::EndOfBlock } else { Taken::Passed })
    }

    /// Says how many segments of this sub-block came in sequence; the next begins after them.
    pub(crate) fn answer(&mut self) -> SdoPayload {
        let unknown = if self.is_complete { SEGMENT_DATA_MAX } else { 0 };
        let end = self.bytes.len().saturating_sub(unknown);
        self.crc.take(self.bytes.get(self.summed..end).unwrap_or_default());
        self.summed = end;
        self.said = encode_sub_response(std::mem::take(&mut self.arrived), self.block_size);
        self.said
    }

    /// What to say when nothing comes: which segments did, or what was said before. The other side may
    /// take the latter for an answer to segments that were all lost, so that it needs a size or a
    /// checksum to find out.
    pub(crate) fn nudge(&mut self) -> Option<SdoPayload> {
        if self.has_begun() {
            return Some(self.answer());
        }
        let is_safe = self.has_crc || self.declared.is_some();
        is_safe.then_some(self.said)
    }

    /// Whether something of this sub-block has come.
    pub(crate) const fn has_begun(&self) -> bool {
        self.arrived > 0
    }

    /// Whether the last segment has come.
    pub(crate) const fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Whether the size was announced.
    pub(crate) const fn is_declared(&self) -> bool {
        self.declared.is_some()
    }

    /// Whether `frame` is the last that counted, come again.
    pub(crate) fn is_again(&self, frame: &SdoPayload) -> bool {
        *frame == self.last
    }

    /// The value, of whose last segment `unused` bytes mean nothing.
    ///
    /// # Errors
    /// When its checksum is not `sum`, where there is one, or it has another size than was announced.
    pub(crate) fn finish(&mut self, unused: u8, sum: u16) -> Result<Vec<u8>, AbortCode> {
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

    /// All but the unused bytes of a last segment must have room.
    fn check_room(&self) -> Result<(), AbortCode> {
        let certain = self.bytes.len().saturating_sub(SEGMENT_DATA_MAX);
        match self.declared {
            Some(declared) if certain > declared => Err(AbortCode::LENGTH_TOO_HIGH),
            None if certain > self.limit => Err(AbortCode::OUT_OF_MEMORY),
            Some(_) | None => Ok(()),
        }
    }
}
