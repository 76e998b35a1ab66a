//! Sender of a block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.16): the client of a download or the server of an
//! upload.
//!
//! A sub-block has up to 127 segments of seven bytes, numbered from 1. Its acknowledgement states how many
//! arrived in sequence; the next sub-block starts after those, so lost segments are sent again.

use canopen_rs::sdo::{SEGMENT_DATA_MAX, SdoPayload};

use crate::abort::AbortCode;
use crate::sdo::crc::Crc;
use crate::sdo::options::BLOCK_SIZE_MAX;

/// Maximum consecutive acknowledgements without progress.
const MAX_FRUITLESS: u8 = 8;

/// Value in transfer, and its progress.
#[derive(Clone, Debug)]
pub struct Sender {
    bytes: Vec<u8>,
    /// First byte of the current sub-block; the bytes before it have arrived.
    begin: usize,
    /// CRC of the bytes that have arrived.
    crc: Crc,
    /// Segments per sub-block.
    block_size: u8,
    /// Segments of the current sub-block that are sent.
    sent: u8,
    /// Segments that arrived, by the previous acknowledgement.
    arrived: u8,
    fruitless: u8,
}

impl Sender {
    /// Returns a sender of `bytes`.
    ///
    /// # Errors
    /// Returns an abort code unless `block_size` is within 1..=127.
    pub fn new(bytes: Vec<u8>, block_size: u8) -> Result<Self, AbortCode> {
        let block_size = checked(block_size)?;
        let crc = Crc::default();
        Ok(Self { bytes, begin: 0, crc, block_size, sent: 0, arrived: 0, fruitless: 0 })
    }

    /// Returns the next segment; `None` once an acknowledgement is due.
    pub fn next_segment(&mut self) -> Option<SdoPayload> {
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

    /// Returns whether [`next_segment`](Self::next_segment) has one.
    pub const fn has_next(&self) -> bool {
        self.sent < self.block_size && (self.sent == 0 || self.place(self.sent) < self.bytes.len())
    }

    /// Takes the acknowledgement of a sub-block: `arrived` segments in sequence, and the size of the next
    /// sub-block. Returns true once the whole value has arrived.
    ///
    /// # Errors
    /// Returns an abort code if more arrived than was sent, if nothing arrives repeatedly, or if `block_size`
    /// is not within 1..=127.
    pub fn answered(&mut self, arrived: u8, block_size: u8) -> Result<bool, AbortCode> {
        // A repeated acknowledgement of the previous sub-block: nothing of the current one has arrived.
        let is_again = arrived > self.sent && arrived == self.arrived;
        if arrived > self.sent && !is_again {
            return Err(AbortCode::SEQUENCE_NUMBER_INVALID);
        }
        let arrived = if is_again { 0 } else { arrived };
        self.fruitless = if arrived == 0 { self.fruitless + 1 } else { 0 };
        if self.fruitless > MAX_FRUITLESS {
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

    /// Starts the current sub-block again.
    ///
    /// # Errors
    /// Returns an abort code after too many repetitions.
    pub fn again(&mut self) -> Result<(), AbortCode> {
        self.answered(0, self.block_size).map(|_| ())
    }

    /// Number of unused bytes in the last segment.
    pub fn unused(&self) -> u8 {
        let used = match self.bytes.len() % SEGMENT_DATA_MAX {
            0 if !self.bytes.is_empty() => SEGMENT_DATA_MAX,
            used => used,
        };
        u8::try_from(SEGMENT_DATA_MAX - used).unwrap_or_default()
    }

    /// CRC of all bytes that have arrived.
    pub const fn sum(&self) -> u16 {
        self.crc.sum()
    }

    /// Offset of segment `place`, counted from 0.
    const fn place(&self, place: u8) -> usize {
        #[expect(clippy::as_conversions, reason = "a constant function has no `from`; u8 fits")]
        let place = place as usize;
        self.begin + place * SEGMENT_DATA_MAX
    }
}

/// Checks a block size.
///
/// # Errors
/// Returns an abort code unless it is within 1..=127.
fn checked(block_size: u8) -> Result<u8, AbortCode> {
    let is_valid = (1..=BLOCK_SIZE_MAX).contains(&block_size);
    if is_valid { Ok(block_size) } else { Err(AbortCode::BLOCK_SIZE_INVALID) }
}

/// Bit c of a segment: it is the last one.
pub(super) const LAST: u8 = 0x80;
