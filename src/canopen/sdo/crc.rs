//! CRC of a block transfer (CiA 301, 7.2.4.3.16): CRC-16 with the polynomial x¹⁶ + x¹² + x⁵ + 1, initial value
//! zero, most significant bit first.

/// CRC of the bytes taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Crc(u16);

impl Crc {
    /// Takes further bytes.
    pub(crate) fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let [high, low] = self.0.to_be_bytes();
            let step = TABLE.get(usize::from(high ^ byte)).copied().unwrap_or_default();
            self.0 = u16::from_be_bytes([low, 0]) ^ step;
        }
    }

    /// CRC value.
    pub(crate) const fn sum(self) -> u16 {
        self.0
    }
}

const POLYNOMIAL: u16 = 0x1021;

/// Contribution of each value of the byte shifted out.
const TABLE: [u16; 256] = table();

#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::indexing_slicing,
    reason = "computed when compiled, with `byte` below 256; a constant has no `try_from`"
)]
const fn table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut rest = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            rest = if rest & 0x8000 == 0 { rest << 1 } else { rest << 1 ^ POLYNOMIAL };
            bit += 1;
        }
        table[byte] = rest;
        byte += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn crc(bytes: &[u8]) -> u16 {
        let mut crc = Crc::default();
        crc.take(bytes);
        crc.sum()
    }

    #[test]
    fn check_value_is_that_of_the_standard() {
        assert_eq!(crc(b"123456789"), 0x31C3);
    }

    proptest! {
        #[test]
        fn crc_is_the_bitwise_remainder_for_any_split(
            bytes in proptest::collection::vec(any::<u8>(), 0..600),
            cut in 0_usize..600,
        ) {
            prop_assert_eq!(crc(&bytes), canopen_rs::sdo::block::crc16(&bytes));
            let (head, tail) = bytes.split_at(cut.min(bytes.len()));
            let mut pieces = Crc::default();
            pieces.take(head);
            pieces.take(tail);
            prop_assert_eq!(pieces.sum(), crc(&bytes));
        }
    }
}
