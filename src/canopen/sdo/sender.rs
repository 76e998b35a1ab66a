//! A value on its way in sub-blocks (CiA 301, 7.2.4.3.9 to 7.2.4.3.16): the side that sends, be it the
//! client of a download or the server of an upload.
//!
//! Up to 127 segments of seven bytes, numbered from 1, go out before one answer says how many arrived
//! in sequence. The next sub-block begins after those: what was lost is sent again. Who may send when,
//! and the frames before and after, are not told here.

use canopen_rs::sdo::SEGMENT_DATA_MAX;
use canopen_rs::sdo::SdoPayload;

use crate::abort::AbortCode;
use crate::sdo::crc::Crc;
use crate::sdo::terms::BLOCK_SIZE_MAX;

/// How often in a row the other side may say that nothing has arrived.
const IN_VAIN: u8 = 8;

/// A value, and how far it has got.
#[derive(Clone, Debug)]
pub(crate) struct Sender {
    bytes: Vec<u8>,
    /// Where the sub-block under way begins; what is before has arrived.
    begin: usize,
    /// Of what is before.
    crc: Crc,
    /// Segments the sub-block may have.
    block_size: u8,
    /// Segments of it that have been sent.
    sent: u8,
    /// What the answer to the sub-block before said.
    arrived: u8,
    in_vain: u8,
}

impl Sender {
    /// Nothing of `bytes` is sent yet.
    ///
    /// # Errors
    /// When `block_size` is not 1 to 127.
    pub(crate) fn new(bytes: Vec<u8>, block_size: u8) -> Result<Self, AbortCode> {
        let block_size = checked(block_size)?;
        let crc = Crc::default();
        Ok(Self { bytes, begin: 0, crc, block_size, sent: 0, arrived: 0, in_vain: 0 })
    }

    /// The next segment of the sub-block under way, `None` once an answer is due.
    pub(crate) fn next(&mut self) -> Option<SdoPayload> {
        let at = self.place(self.sent);
        let is_over = self.sent > 0 && at >= self.bytes.len();
        if is_over || self.sent >= self.block_size {
            return None;
        }
        self.sent += 1;
        let rest = self.bytes.get(at..).unwrap_or_default();
        let last = if rest.len() <= SEGMENT_DATA_MAX { LAST } else { 0 };
        let mut segment = [self.sent | last, 0, 0, 0, 0, 0, 0, 0];
        for (to, from) in segment.iter_mut().skip(1).zip(rest) {
            *to = *from;
        }
        Some(segment)
    }

    /// Whether [`next`](Self::next) has a segment.
    pub(crate) const fn has_next(&self) -> bool {
        self.sent < self.block_size && (self.sent == 0 || self.place(self.sent) < self.bytes.len())
    }

    /// Takes the answer to a sub-block: `arrived` segments in sequence, and what the next may have.
    /// True once the whole value has arrived.
    ///
    /// # Errors
    /// When more arrived than was sent, nothing arrives for ever, or `block_size` is not 1 to 127.
    pub(crate) fn answered(&mut self, arrived: u8, block_size: u8) -> Result<bool, AbortCode> {
        // The answer to the sub-block before, said again: of this one nothing has arrived.
        let is_again = arrived > self.sent && arrived == self.arrived;
        if arrived > self.sent && !is_again {
            return Err(AbortCode::SEQUENCE_NUMBER_INVALID);
        }
        let arrived = if is_again { 0 } else { arrived };
        self.in_vain = if arrived == 0 { self.in_vain + 1 } else { 0 };
        if self.in_vain > IN_VAIN {
            return Err(AbortCode::SEQUENCE_NUMBER_INVALID);
        }
        let end = self.place(arrived);
        self.crc.take(self.bytes.get(self.begin..end.min(self.bytes.len())).unwrap_or_default());
        if arrived > 0 && end >= self.bytes.len() {
            self.begin = self.bytes.len();
            return Ok(true);
        }
        self.begin = end;
        self.sent = 0;
        if !is_again {
            self.arrived = arrived;
        }
        self.block_size = checked(block_size)?;
        Ok(false)
    }

    /// Begins the sub-block under way again.
    ///
    /// # Errors
    /// When that has been done too often.
    pub(crate) fn again(&mut self) -> Result<(), AbortCode> {
        self.answered(0, self.block_size).map(|_| ())
    }

    /// How many bytes of the last segment mean nothing.
    pub(crate) fn unused(&self) -> u8 {
        let used = match self.bytes.len() % SEGMENT_DATA_MAX {
            0 if !self.bytes.is_empty() => SEGMENT_DATA_MAX,
            used => used,
        };
        u8::try_from(SEGMENT_DATA_MAX - used).unwrap_or_default()
    }

    /// The checksum of all that has arrived.
    pub(crate) const fn sum(&self) -> u16 {
        self.crc.sum()
    }

    /// The byte that segment `place`, from 0, begins with.
    const fn place(&self, place: u8) -> usize {
        #[expect(clippy::as_conversions, reason = "a constant function has no `from`; u8 fits")]
        let place = place as usize;
        self.begin + place * SEGMENT_DATA_MAX
    }
}

/// # Errors
/// When a sub-block cannot have that many segments.
fn checked(block_size: u8) -> Result<u8, AbortCode> {
    let is_valid = (1..=BLOCK_SIZE_MAX).contains(&block_size);
    if is_valid { Ok(block_size) } else { Err(AbortCode::BLOCK_SIZE_INVALID) }
}

/// Bit c of a segment: no more come.
pub(super) const LAST: u8 = 0x80;
