//! CRC-16 of a block transfer (CiA 301, 7.2.4.3.16): polynomial x¹⁶ + x¹² + x⁵ + 1, initial value zero, most significant
//! bit first.

static CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_XMODEM);

/// CRC of the bytes taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Crc(u16);

impl Crc {
    /// Takes further bytes.
    pub(crate) fn take(&mut self, bytes: &[u8]) {
        let mut digest = CRC.digest_with_initial(self.0);
        digest.update(bytes);
        self.0 = digest.finalize();
    }

    /// CRC value.
    pub(crate) const fn sum(self) -> u16 {
        self.0
    }
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
