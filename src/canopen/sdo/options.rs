//! Options of an SDO transfer: protocol, timeout and maximum size.

use std::time::Duration;

use thiserror::Error;

/// Maximum size of a value, in bytes.
pub const MAX_BYTES: usize = 16 << 20;

/// Maximum size for [`Transfer::read`](crate::sdo::Transfer::read) and
/// [`write`](crate::sdo::Transfer::write), in bytes: 2 s on an idle bus of 1 Mbit/s.
pub const SEGMENTED_BYTES: usize = 1 << 16;

/// Maximum segments of a sub-block (CiA 301, 7.2.4.3.9).
pub(crate) const BLOCK_SIZE_MAX: u8 = 127;

/// Size in bytes up to which a block transfer takes more frames than a segmented one.
pub(super) const BLOCK_THRESHOLD: u8 = 21;

/// Options of an SDO transfer (CiA 301, 7.2.4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoOptions {
    /// Time allowed for each reply. During a block upload one retry doubles it.
    pub timeout: Duration,
    /// Maximum size in bytes; capped at [`MAX_BYTES`].
    pub limit: usize,
    /// Protocol for values that do not fit one frame.
    pub protocol: Protocol,
}

impl SdoOptions {
    /// Uses expedited or segmented transfer, up to [`MAX_BYTES`].
    pub const fn segmented(timeout: Duration) -> Self {
        Self { timeout, limit: MAX_BYTES, protocol: Protocol::Segmented }
    }

    /// Uses the protocol with the fewest frames that the server supports, up to [`MAX_BYTES`].
    pub const fn best(timeout: Duration, block: Block) -> Self {
        Self { timeout, limit: MAX_BYTES, protocol: Protocol::Best(block) }
    }

    /// Uses block transfer, up to [`MAX_BYTES`].
    pub const fn block(timeout: Duration, block: Block) -> Self {
        Self { timeout, limit: MAX_BYTES, protocol: Protocol::Block(block) }
    }

    /// Maximum size of the value, in bytes.
    pub(super) fn max_bytes(&self) -> usize {
        self.limit.min(MAX_BYTES)
    }
}

/// Protocol for values that do not fit one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Segmented transfer: one reply per seven bytes.
    Segmented,
    /// Block transfer: one reply per up to 889 bytes. The server may answer an upload by another protocol.
    Block(Block),
    /// Block transfer where it is shorter; segmented if the server does not support it.
    Best(Block),
}

/// Parameters of a block transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    size: u8,
    has_crc: bool,
    interval: Duration,
}

/// Error of an invalid block size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("block size must be within 1..=127 segments, got {0}")]
pub struct InvalidBlockSize(pub u8);

impl Block {
    /// Returns parameters with `size` segments per sub-block of an upload (the server chooses those of a
    /// download), a CRC, and an interval of 1 ms.
    ///
    /// # Errors
    /// Returns an error unless `size` is within 1..=127.
    pub const fn new(size: u8) -> Result<Self, InvalidBlockSize> {
        if size == 0 || size > BLOCK_SIZE_MAX {
            return Err(InvalidBlockSize(size));
        }
        Ok(Self { size, ..Self::MAX })
    }

    /// Disables the CRC.
    #[must_use]
    pub const fn without_crc(self) -> Self {
        Self { has_crc: false, ..self }
    }

    /// Sets the interval between two sent segments. With zero each call of `on_time` sends one.
    #[must_use]
    pub const fn every(self, interval: Duration) -> Self {
        Self { interval, ..self }
    }

    /// Segments per sub-block of an upload, 1 to 127.
    pub const fn size(self) -> u8 {
        self.size
    }

    /// Returns whether a CRC is requested.
    pub const fn has_crc(self) -> bool {
        self.has_crc
    }

    /// Interval between two sent segments.
    pub const fn interval(self) -> Duration {
        self.interval
    }

    /// 127 segments, a CRC, and 1 ms between segments, so that no queue overflows and no process data waits.
    pub const MAX: Self =
        Self { size: BLOCK_SIZE_MAX, has_crc: true, interval: Duration::from_millis(1) };
}

impl Default for Block {
    fn default() -> Self {
        Self::MAX
    }
}
