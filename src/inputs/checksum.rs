//! Checksum of the frames that a node has sent in one call.

use canopen::frame::{Channel, Telegram};

/// FNV-1a, 32 bits, over each frame: channel u8, COB-ID u16, flag of a remote frame u8, length u8, data. It detects
/// differences, but not manipulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checksum {
    value: u32,
    frames: u32,
}

impl Default for Checksum {
    fn default() -> Self {
        Self { value: 0x811C_9DC5, frames: 0 }
    }
}

impl Checksum {
    /// Adds a frame.
    pub fn add(&mut self, telegram: &Telegram) {
        let Telegram { channel: Channel(channel), frame } = telegram;
        let [low, high] = frame.cob_id.to_le_bytes();
        let head = [*channel, low, high, u8::from(frame.is_remote()), frame.length()];
        for byte in head.iter().chain(frame.data()) {
            self.value = (self.value ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
        }
        self.frames = self.frames.saturating_add(1);
    }

    /// Returns the 32 bits of the hash; the offset basis before the first frame.
    pub const fn value(&self) -> u32 {
        self.value
    }

    /// Returns the number of frames added.
    pub const fn frames(&self) -> u32 {
        self.frames
    }
}
