//! Length of a frame on the bus, in bits: classical CAN with an 11-bit identifier (ISO 11898-1), with the 3-bit
//! interframe space.

use crate::frame::Frame;

/// Bits besides data: start, identifier, RTR, IDE, r0, DLC, CRC, delimiters, ACK, end and interframe space.
const OVERHEAD: u32 = 47;

/// Part of those subject to bit stuffing: from start of frame to the CRC sequence.
const STUFFED_OVERHEAD: u32 = 34;

/// Polynomial of the CRC-15.
const CRC_POLYNOMIAL: u16 = 0x4599;

/// Length of a frame with `bytes` data bytes, without stuff bits.
pub const fn unstuffed(bytes: u32) -> u32 {
    OVERHEAD + 8 * bytes
}

/// Maximum length of a frame with `bytes` data bytes: 55 + 10 n (Davis et al. 2007).
pub const fn worst_case(bytes: u32) -> u32 {
    unstuffed(bytes) + (STUFFED_OVERHEAD + 8 * bytes - 1) / 4
}

/// Exact length of a frame.
pub fn exact(frame: &Frame) -> u32 {
    let mut sent = Stuffing::default();
    sent.push(0, 1); // start of frame, dominant
    sent.push(u32::from(frame.cob_id), 11);
    sent.push(u32::from(frame.is_remote()), 1);
    sent.push(0, 2); // IDE, r0, both dominant
    sent.push(u32::from(frame.length()), 4);
    let mut bytes = 0;
    for _ in frame.data() {
        bytes += 1;
    }
    for byte in frame.data() {
        sent.push(u32::from(*byte), 8);
    }
    let crc = sent.crc;
    sent.push(u32::from(crc), 15);
    unstuffed(bytes) + sent.stuff_bits
}

/// Counter of stuff bits, and CRC of the unstuffed stream. A stuff bit follows five equal bits and is the first of
/// the next run.
#[derive(Default)]
struct Stuffing {
    last: Option<bool>,
    run: u32,
    stuff_bits: u32,
    crc: u16,
}

impl Stuffing {
    /// Adds the lowest `count` bits of `value`, most significant first.
    fn push(&mut self, value: u32, count: u32) {
        for place in (0..count).rev() {
            self.bit(value >> place & 1 == 1);
        }
    }

    fn bit(&mut self, bit: bool) {
        let divide = bit != (self.crc >> 14 & 1 == 1);
        self.crc = self.crc << 1 & 0x7FFF;
        if divide {
            self.crc ^= CRC_POLYNOMIAL;
        }
        self.run = if self.last == Some(bit) { self.run + 1 } else { 1 };
        self.last = Some(bit);
        if self.run == 5 {
            self.stuff_bits += 1;
            self.last = Some(!bit);
            self.run = 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worst_case_is_55_bits_and_10_per_byte() {
        for bytes in 0..=8 {
            assert_eq!(worst_case(bytes), 55 + 10 * bytes);
        }
    }

    #[test]
    fn all_zero_frame_has_the_maximum_of_stuff_bits() {
        // 1 + 11 + 3 + 4 zero bits and a zero CRC: 34 dominant bits in a row. The first stuff bit follows the fifth bit
        // and breaks the run; further ones follow every fourth.
        let zeros = exact(&Frame::new(0, []));
        assert_eq!(zeros, unstuffed(0) + 34 / 5);
    }

    #[test]
    fn remote_frame_has_no_data_bits() {
        let bits = exact(&Frame::remote(0x701, 1));
        assert!((unstuffed(0)..=worst_case(0)).contains(&bits), "{bits}");
    }

    #[test]
    fn exact_length_is_within_the_bounds() {
        for seed in 0..2_000_u32 {
            let [a, b, c, d] = seed.wrapping_mul(2_654_435_761).to_le_bytes();
            let frame = Frame::new(u16::from(a) << 3, [b, c, d, a ^ b, 0xFF, 0, a]);
            let bits = exact(&frame);
            assert!((unstuffed(7)..=worst_case(7)).contains(&bits), "{frame}: {bits}");
        }
    }
}
