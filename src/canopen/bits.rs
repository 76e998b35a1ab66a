//! Length of a frame on the bus, in bits: classical CAN with an 11-bit identifier (ISO 11898-1), with the 3-bit
//! interframe space.

use crate::frame::Frame;

/// Bits besides data: start, identifier, RTR, IDE, r0, DLC, CRC, delimiters, ACK, end and interframe space.
const OVERHEAD: u32 = 47;

/// Part of those subject to bit stuffing: from start of frame to the CRC sequence.
const STUFFED_OVERHEAD: u32 = 34;

/// Remainders of four bits by the polynomial of the CRC-15, 4599h.
const CRC_REMAINDERS: [u16; 16] = [
    0x0000, 0x4599, 0x4EAB, 0x0B32, 0x58CF, 0x1D56, 0x1664, 0x53FD, 0x7407, 0x319E, 0x3AAC, 0x7F35,
    0x2CC8, 0x6951, 0x6263, 0x27FA,
];

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
    // Start of frame, IDE and r0 are dominant: zeros.
    let id = u32::from(frame.cob_id) << 7 | u32::from(frame.is_remote()) << 6;
    let head = id | u32::from(frame.length());
    let mut crc = [16, 12, 8, 4, 0].into_iter().fold(0, |crc, place| crc_after(crc, head >> place));
    let (mut stream, mut bytes) = (u128::from(head), 0);
    for byte in frame.data() {
        crc = crc_after(crc_after(crc, u32::from(byte >> 4)), u32::from(*byte));
        stream = stream << 8 | u128::from(*byte);
        bytes += 1;
    }
    let length = STUFFED_OVERHEAD + 8 * bytes;
    unstuffed(bytes) + stuff_bits(stream << 15 | u128::from(crc), length)
}

/// Returns the CRC after the lowest four bits of `value`.
fn crc_after(crc: u32, value: u32) -> u32 {
    let [place, ..] = ((crc >> 11 ^ value) & 0xF).to_le_bytes();
    let remainder = CRC_REMAINDERS.get(usize::from(place)).copied().unwrap_or_default();
    crc << 4 & 0x7FFF ^ u32::from(remainder)
}

/// Returns the number of stuff bits in the lowest `length` bits of a stream. A stuff bit follows five equal bits and is
/// the first of the next run.
fn stuff_bits(stream: u128, length: u32) -> u32 {
    // A one for each bit that equals the next; the highest comes first.
    let mut pairs = !(stream ^ stream << 1) << (u128::BITS - length);
    pairs &= u128::MAX << (u128::BITS + 1 - length);
    let mut count = 0;
    loop {
        let threes = pairs & pairs << 1;
        let fives = threes & threes << 2;
        if fives == 0 {
            return count;
        }
        // The stuff bit takes the place of the fifth, from which it differs.
        let fifth = fives.leading_zeros() + 4;
        pairs = pairs << fifth ^ 1 << (u128::BITS - 1);
        count += 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const POLYNOMIAL: u16 = 0x4599;

    /// Counter of stuff bits, and CRC of the unstuffed stream, a bit at a time.
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
                self.crc ^= POLYNOMIAL;
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

    fn bit_by_bit(frame: &Frame) -> u32 {
        let mut sent = Stuffing::default();
        sent.push(0, 1); // start of frame, dominant
        sent.push(u32::from(frame.cob_id), 11);
        sent.push(u32::from(frame.is_remote()), 1);
        sent.push(0, 2); // IDE, r0, both dominant
        sent.push(u32::from(frame.length()), 4);
        for byte in frame.data() {
            sent.push(u32::from(*byte), 8);
        }
        let crc = sent.crc;
        sent.push(u32::from(crc), 15);
        unstuffed(u32::try_from(frame.data().len()).unwrap()) + sent.stuff_bits
    }

    #[test]
    fn lengths_without_data_are_those_bit_by_bit() {
        for cob_id in 0..=0x7FF {
            for frame in [Frame::new(cob_id, []), Frame::remote(cob_id, 8)] {
                assert_eq!(exact(&frame), bit_by_bit(&frame), "{frame}");
            }
        }
    }

    proptest! {
        #[test]
        fn lengths_with_data_are_those_bit_by_bit(
            cob_id in 0..=0x7FF_u16,
            // Stuff bits are where bits are equal.
            data in prop::collection::vec(prop_oneof![any::<u8>(), Just(0), Just(0xFF)], 0..=8),
        ) {
            let frame = Frame::from_slice(cob_id, &data).unwrap();
            prop_assert_eq!(exact(&frame), bit_by_bit(&frame), "{}", frame);
        }
    }

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
