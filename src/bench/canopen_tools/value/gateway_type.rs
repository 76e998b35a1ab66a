//! Data types of CiA 309-3, by name and by their number in an EDS.
//!
//! [`value`](crate::value) converts between text and bytes.
//!
//! | name       | type (CiA 301, 7.4.7.1)      | as text                                                 |
//! |------------|------------------------------|---------------------------------------------------------|
//! | `b`        | BOOLEAN                      | `0` `1` `false` `true`                                  |
//! | `i8`–`i64` | INTEGER, 8 to 64 bits        | `-5` `0x1F` `1Fh`                                       |
//! | `u8`–`u64` | UNSIGNED, 8 to 64 bits       | `31` `0x1F` `1Fh`                                       |
//! | `x8`–`x64` | the same, shown and read as hexadecimal | `1F` `0x1F` `1Fh`                            |
//! | `r32` `r64`| REAL                         | `1.5` `-2e-3`                                           |
//! | `vs`       | VISIBLE_STRING               | the text, ASCII                                         |
//! | `us`       | UNICODE_STRING               | the text; UTF-16 in the object                          |
//! | `os` `d`   | OCTET_STRING, DOMAIN         | hexadecimal bytes: `01 AB ff`, `01ABff`                 |
//! | `t` `td`   | TIME_OF_DAY, TIME_DIFFERENCE | days, since 1984 or between, and milliseconds: `15665:31238000` |

use std::str::FromStr;

use derive_more::Display;
use thiserror::Error;

use crate::value::numeral::decimal;
use canopen::data_type::{self, DataType, Kind};

/// Width of an integer, 1 to 8 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Width(u8);

impl Width {
    /// Returns a width of 8, 16, … 64 bits.
    pub const fn of_bits(bits: u8) -> Option<Self> {
        if bits.is_multiple_of(8) && bits >= 8 && bits <= 64 { Some(Self(bits / 8)) } else { None }
    }

    pub const fn bits(self) -> u8 {
        self.0 * 8
    }

    pub fn bytes(self) -> usize {
        usize::from(self.0)
    }
}

/// Data type of an object.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Hash)]
pub enum GatewayType {
    /// `b`
    #[display("b")]
    Boolean,
    /// `i8` to `i64`
    #[display("i{}", _0.bits())]
    Signed(Width),
    /// `u8` to `u64`
    #[display("u{}", _0.bits())]
    Unsigned(Width),
    /// `x8` to `x64`
    #[display("x{}", _0.bits())]
    Hexadecimal(Width),
    /// `r32`
    #[display("r32")]
    Real32,
    /// `r64`
    #[display("r64")]
    Real64,
    /// `vs`
    #[display("vs")]
    VisibleString,
    /// `us`
    #[display("us")]
    UnicodeString,
    /// `os`
    #[display("os")]
    OctetString,
    /// `d`
    #[display("d")]
    Domain,
    /// `t`
    #[display("t")]
    TimeOfDay,
    /// `td`
    #[display("td")]
    TimeDifference,
}

/// Error of an unknown type name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "unknown data type \"{0}\"; expected b, u8 to u64, i8 to i64, x8 to x64, r32, r64, vs, us, os, d, t, td"
)]
pub struct NoType(String);

impl FromStr for GatewayType {
    type Err = NoType;

    fn from_str(text: &str) -> Result<Self, NoType> {
        let unknown = || NoType(text.to_owned());
        Ok(match text {
            "b" => Self::Boolean,
            "r32" => Self::Real32,
            "r64" => Self::Real64,
            "vs" => Self::VisibleString,
            "us" => Self::UnicodeString,
            "os" => Self::OctetString,
            "d" => Self::Domain,
            "t" => Self::TimeOfDay,
            "td" => Self::TimeDifference,
            _ => {
                let (kind, bits) = text.split_at_checked(1).ok_or_else(unknown)?;
                let bits = decimal(bits).and_then(|bits| u8::try_from(bits).ok());
                let width = bits.and_then(Width::of_bits).ok_or_else(unknown)?;
                match kind {
                    "i" => Self::Signed(width),
                    "u" => Self::Unsigned(width),
                    "x" => Self::Hexadecimal(width),
                    _ => return Err(unknown()),
                }
            }
        })
    }
}

impl GatewayType {
    /// Returns the type with a number of CiA 301, 7.4.7.1, as used in an EDS.
    pub fn of_number(number: u16) -> Option<Self> {
        let DataType { kind, bits, .. } = data_type::find(number)?;
        let width = bits.and_then(Width::of_bits);
        Some(match (number, kind) {
            (0x0C, _) => Self::TimeOfDay,
            (0x0D, _) => Self::TimeDifference,
            (data_type::DOMAIN, _) => Self::Domain,
            (_, Kind::Boolean) => Self::Boolean,
            (_, Kind::Signed) => Self::Signed(width?),
            (_, Kind::Unsigned) => Self::Unsigned(width?),
            (_, Kind::Real) if bits == Some(32) => Self::Real32,
            (_, Kind::Real) => Self::Real64,
            (_, Kind::Text) => Self::VisibleString,
            (_, Kind::UnicodeText) => Self::UnicodeString,
            (_, Kind::Octets) => Self::OctetString,
        })
    }

    /// Size of a value in bytes; `None` for types of variable length.
    pub fn size(self) -> Option<usize> {
        match self {
            Self::Boolean => Some(1),
            Self::Signed(width) | Self::Unsigned(width) | Self::Hexadecimal(width) => {
                Some(width.bytes())
            }
            Self::Real32 => Some(4),
            Self::Real64 => Some(8),
            Self::TimeOfDay | Self::TimeDifference => Some(6),
            Self::VisibleString | Self::UnicodeString | Self::OctetString | Self::Domain => None,
        }
    }

    /// Range of an integer type; `None` for others.
    pub fn range(self) -> Option<(i128, i128)> {
        match self {
            Self::Boolean => Some((0, 1)),
            Self::Signed(width) => {
                let half = 1_i128 << (width.bits() - 1);
                Some((-half, half - 1))
            }
            Self::Unsigned(width) | Self::Hexadecimal(width) => {
                Some((0, (1_i128 << width.bits()) - 1))
            }
            Self::Real32
            | Self::Real64
            | Self::VisibleString
            | Self::UnicodeString
            | Self::OctetString
            | Self::Domain
            | Self::TimeOfDay
            | Self::TimeDifference => None,
        }
    }
}

/// Names of all types.
#[cfg(test)]
pub(super) fn names() -> Vec<String> {
    let wide = |kind| (1..=8).map(move |width| format!("{kind}{}", width * 8));
    let plain = ["b", "r32", "r64", "vs", "us", "os", "d", "t", "td"].map(str::to_owned);
    wide('i').chain(wide('u')).chain(wide('x')).chain(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn type_names_parse_to_themselves() {
        for name in names() {
            assert_eq!(name.parse::<GatewayType>().unwrap().to_string(), name);
        }
        for name in ["", "i", "u7", "u9", "u72", "u0", "U8", "r16", "i+8", "ü8", "string"] {
            assert!(name.parse::<GatewayType>().is_err(), "{name}");
        }
    }

    #[test]
    fn type_numbers_match_their_sizes() {
        for (number, name) in
            [(1, "b"), (3, "i16"), (7, "u32"), (9, "vs"), (0x16, "u24"), (0x1B, "u64")]
        {
            assert_eq!(GatewayType::of_number(number).unwrap().to_string(), name);
        }
        assert_eq!(GatewayType::of_number(0x17), None);
    }
}
