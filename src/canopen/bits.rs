//! How long a frame is on the wire, in bits: classical CAN with an 11-bit identifier (ISO 11898-1),
//! the interframe space of 3 bits included.

use crate::frame::Frame;

/// Start, identifier, RTR, IDE, r0, DLC, CRC, delimiters, acknowledge, end of frame and interframe space.
const OVERHEAD: u32 = 47;

/// Of those, the bits that stuffing applies to: start of frame to the end of the CRC sequence.
const STUFFED_OVERHEAD: u32 = 34;

/// The CRC-15 polynomial of CAN.
const CRC_POLYNOMIAL: u16 = 0x4599;

/// The least a frame of `bytes` data bytes can take: no stuff bit at all.
pub const fn unstuffed(bytes: u32) -> u32 {
    OVERHEAD + 8 * bytes
}

/// The most a frame of `bytes` data bytes can take: 55 + 10 n (Davis et al. 2007).
pub const fn worst_case(bytes: u32) -> u32 {
    unstuffed(bytes) + (STUFFED_OVERHEAD + 8 * bytes - 1) / 4
}

/// What exactly this frame takes.
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

/// Counts stuff bits (one after five equal bits, itself counted as the first of the next run) and
/// carries the CRC of the unstuffed stream.
#[derive(Default)]
struct Stuffing {
    last: Option<bool>,
    run: u32,
    stuff_bits: u32,
    crc: u16,
}

impl Stuffing {
    /// The lowest `count` bits of `value`, most significant first.
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
    fn the_worst_case_is_fifty_five_and_ten_a_byte() {
        for bytes in 0..=8 {
            assert_eq!(worst_case(bytes), 55 + 10 * bytes);
        }
    }

    #[test]
    fn an_all_zero_frame_is_stuffed_after_every_fourth_bit_but_the_first() {
        // 1 + 11 + 3 + 4 zero bits, CRC zero: 34 dominant bits in a row, a stuff bit after the
        // fifth, then after every fifth of what follows (the stuff bit breaks the run).
        let zeros = exact(&Frame::new(0, []));
        assert_eq!(zeros, unstuffed(0) + 34 / 5);
    }

    #[test]
    fn a_remote_frame_is_on_the_wire_without_the_data_it_asks_for() {
        let bits = exact(&Frame::remote(0x701, 1));
        assert!((unstuffed(0)..=worst_case(0)).contains(&bits), "{bits}");
    }

    #[test]
    fn exact_lies_between_the_bounds() {
        for seed in 0..2_000_u32 {
            let [a, b, c, d] = seed.wrapping_mul(2_654_435_761).to_le_bytes();
            let frame = Frame::new(u16::from(a) << 3, [b, c, d, a ^ b, 0xFF, 0, a]);
            let bits = exact(&frame);
            assert!((unstuffed(7)..=worst_case(7)).contains(&bits), "{frame}: {bits}");
        }
    }
}
