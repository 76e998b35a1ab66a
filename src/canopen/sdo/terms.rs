//! On which terms a transfer is made: by which protocol, how patient, and how much at most.

use std::time::Duration;

use thiserror::Error;

/// The largest value carried either way, in bytes.
pub const MAX_BYTES: usize = 16 << 20;

/// The largest value [`Transfer::read`](crate::sdo::Transfer::read) and
/// [`write`](crate::sdo::Transfer::write) carry, in bytes: 2 s on an idle bus of 1 Mbit/s.
pub const SEGMENTED_BYTES: usize = 1 << 16;

/// The most segments a sub-block has (CiA 301, 7.2.4.3.9).
pub(crate) const BLOCK_SIZE_MAX: u8 = 127;

/// Up to this size, in bytes, a block transfer takes more frames than a segmented one.
pub(super) const SHORT: u8 = 21;

/// How a transfer is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terms {
    /// How long the server may take for each reply. Amid the segments of a block it is asked once more
    /// before it counts as silent, and has this time again.
    pub timeout: Duration,
    /// The largest value that is taken, in bytes; at most [`MAX_BYTES`] count.
    pub limit: usize,
    /// How what does not fit one frame is carried.
    pub protocol: Protocol,
}

impl Terms {
    /// Expedited or segmented, up to [`MAX_BYTES`].
    pub const fn segmented(timeout: Duration) -> Self {
        Self { timeout, limit: MAX_BYTES, protocol: Protocol::Segmented }
    }

    /// Whatever takes the fewest frames and the server can do, up to [`MAX_BYTES`].
    pub const fn best(timeout: Duration, block: Block) -> Self {
        Self { timeout, limit: MAX_BYTES, protocol: Protocol::Best(block) }
    }

    /// By block transfer, up to [`MAX_BYTES`].
    pub const fn block(timeout: Duration, block: Block) -> Self {
        Self { timeout, limit: MAX_BYTES, protocol: Protocol::Block(block) }
    }

    /// The largest value that is taken.
    pub(super) fn most(&self) -> usize {
        self.limit.min(MAX_BYTES)
    }
}

/// How a value is carried that does not fit one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Each seven bytes are asked for and answered.
    Segmented,
    /// Up to 889 bytes have one answer. A value of any size is written so; one that is read may be
    /// answered otherwise, as the server likes.
    Block(Block),
    /// Block transfer where it is shorter; segmented with a server that does not know it.
    Best(Block),
}

/// How block transfer is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    size: u8,
    has_crc: bool,
    interval: Duration,
}

/// A sub-block that no protocol has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a sub-block has 1 to 127 segments, not {0}")]
pub struct InvalidBlockSize(pub u8);

impl Block {
    /// Sub-blocks of up to `size` segments when reading; when writing, the server decides. With a
    /// checksum, and a segment a millisecond.
    ///
    /// # Errors
    /// When `size` is not 1 to 127.
    pub const fn new(size: u8) -> Result<Self, InvalidBlockSize> {
        if size == 0 || size > BLOCK_SIZE_MAX {
            return Err(InvalidBlockSize(size));
        }
        Ok(Self { size, ..Self::LARGEST })
    }

    /// The same without a checksum.
    #[must_use]
    pub const fn without_crc(self) -> Self {
        Self { has_crc: false, ..self }
    }

    /// The same with this time between two segments that are written; zero leaves the pace to the owner,
    /// who is asked for one with every call of `on_time`.
    #[must_use]
    pub const fn every(self, interval: Duration) -> Self {
        Self { interval, ..self }
    }

    /// Segments of a sub-block that is read, 1 to 127.
    pub const fn size(self) -> u8 {
        self.size
    }

    /// Whether a checksum is asked for.
    pub const fn has_crc(self) -> bool {
        self.has_crc
    }

    /// The time between two segments that are written.
    pub const fn interval(self) -> Duration {
        self.interval
    }

    /// 127 segments, a checksum, and a segment a millisecond: no queue runs over, no process data waits.
    pub const LARGEST: Self =
        Self { size: BLOCK_SIZE_MAX, has_crc: true, interval: Duration::from_millis(1) };
}

impl Default for Block {
    fn default() -> Self {
        Self::LARGEST
    }
}
