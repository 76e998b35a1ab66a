//! Static data types of CiA 301 (7.4.7.1): number, name, length and kind.
//!
//! [`eds`](crate::eds) parses their values.

use std::ops::RangeInclusive;

/// Kind of a data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One bit: 0 is false, 1 is true.
    Boolean,
    /// Two's complement integer.
    Signed,
    /// Unsigned integer.
    Unsigned,
    /// IEEE 754 floating-point number.
    Real,
    /// Text of 8-bit characters.
    Text,
    /// Text of 16-bit characters.
    UnicodeText,
    /// Any number of bytes.
    Octets,
}

/// Static data type with an index of its own in the object dictionary (CiA 301, 7.4.7.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DataType {
    /// Number: an index below 0020h.
    pub number: u16,
    /// Name in CiA 301.
    pub name: &'static str,
    /// Encoding of the values.
    pub kind: Kind,
    /// Length in bits; `None` for texts and domains.
    pub bits: Option<u8>,
}

/// UNSIGNED8: sub-index 0 of arrays and records.
pub const UNSIGNED8: u16 = 0x05;
/// UNSIGNED32: COB-IDs and mapping entries.
pub const UNSIGNED32: u16 = 0x07;
/// DOMAIN: any number of bytes, whose format the application defines.
pub const DOMAIN: u16 = 0x0F;

/// All types.
const TYPES: [DataType; 25] = [
    fixed(0x01, "BOOLEAN", Kind::Boolean, 1),
    fixed(0x02, "INTEGER8", Kind::Signed, 8),
    fixed(0x03, "INTEGER16", Kind::Signed, 16),
    fixed(0x04, "INTEGER32", Kind::Signed, 32),
    fixed(UNSIGNED8, "UNSIGNED8", Kind::Unsigned, 8),
    fixed(0x06, "UNSIGNED16", Kind::Unsigned, 16),
    fixed(UNSIGNED32, "UNSIGNED32", Kind::Unsigned, 32),
    fixed(0x08, "REAL32", Kind::Real, 32),
    any_length(0x09, "VISIBLE_STRING", Kind::Text),
    any_length(0x0A, "OCTET_STRING", Kind::Octets),
    any_length(0x0B, "UNICODE_STRING", Kind::UnicodeText),
    fixed(0x0C, "TIME_OF_DAY", Kind::Unsigned, 48),
    fixed(0x0D, "TIME_DIFFERENCE", Kind::Unsigned, 48),
    any_length(DOMAIN, "DOMAIN", Kind::Octets),
    fixed(0x10, "INTEGER24", Kind::Signed, 24),
    fixed(0x11, "REAL64", Kind::Real, 64),
    fixed(0x12, "INTEGER40", Kind::Signed, 40),
    fixed(0x13, "INTEGER48", Kind::Signed, 48),
    fixed(0x14, "INTEGER56", Kind::Signed, 56),
    fixed(0x15, "INTEGER64", Kind::Signed, 64),
    fixed(0x16, "UNSIGNED24", Kind::Unsigned, 24),
    fixed(0x18, "UNSIGNED40", Kind::Unsigned, 40),
    fixed(0x19, "UNSIGNED48", Kind::Unsigned, 48),
    fixed(0x1A, "UNSIGNED56", Kind::Unsigned, 56),
    fixed(0x1B, "UNSIGNED64", Kind::Unsigned, 64),
];

const fn fixed(number: u16, name: &'static str, kind: Kind, bits: u8) -> DataType {
    DataType { number, name, kind, bits: Some(bits) }
}

const fn any_length(number: u16, name: &'static str, kind: Kind) -> DataType {
    DataType { number, name, kind, bits: None }
}

/// Returns the type of a number; `None` for records and manufacturer-specific types.
pub fn find(number: u16) -> Option<DataType> {
    TYPES.iter().find(|data_type| data_type.number == number).copied()
}

/// Size of a value in bytes; `None` for types of variable length.
pub fn size(number: u16) -> Option<usize> {
    find(number)?.bytes()
}

impl DataType {
    /// Size of a value in bytes; `None` for texts and domains.
    pub fn bytes(&self) -> Option<usize> {
        self.bits.map(|bits| usize::from(bits.div_ceil(8)))
    }

    /// Range of integers and BOOLEAN.
    pub fn range(&self) -> Option<RangeInclusive<i128>> {
        let bits = self.bits?;
        match self.kind {
            Kind::Boolean | Kind::Unsigned => Some(0..=(1 << bits) - 1),
            Kind::Signed => Some(-(1 << (bits - 1))..=(1 << (bits - 1)) - 1),
            Kind::Real | Kind::Text | Kind::UnicodeText | Kind::Octets => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_those_of_the_standard() {
        let range = |number| find(number).unwrap().range().unwrap();
        assert_eq!(range(0x01), 0..=1);
        assert_eq!(range(0x02), -128..=127);
        assert_eq!(range(0x06), 0..=0xFFFF);
        assert_eq!(range(0x15), i128::from(i64::MIN)..=i128::from(i64::MAX));
        assert_eq!(range(0x1B), 0..=i128::from(u64::MAX));
        assert_eq!(find(0x08).unwrap().range(), None);
    }

    #[test]
    fn lengths_are_whole_bytes() {
        assert_eq!([0x01, 0x10, 0x0C, 0x1B].map(size), [Some(1), Some(3), Some(6), Some(8)]);
        assert_eq!([0x09, 0x0E, 0x17, 0x20, 0x40].map(size), [None; 5]);
    }
}
