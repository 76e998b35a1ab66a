//! Values as text and as the little-endian bytes of an object: conversion in both directions.
//!
//! [`gateway_type`] defines the text of each [`GatewayType`].

pub mod gateway_type;
pub mod numeral;

use std::fmt;

use derive_more::Display;
use thiserror::Error;

use crate::candump;
use crate::value::gateway_type::{GatewayType, Width};
use crate::value::numeral::{bare, hexadecimal, whole};
use canopen::time_stamp::TimeOfDay;

/// Error of a text or content that is not a value of its type.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ValueError {
    /// Malformed text.
    #[error("{text}: not {expected}")]
    Malformed {
        /// Text as given.
        text: String,
        /// Expected form.
        expected: &'static str,
    },
    /// Out of range of the type or the object.
    #[error("{text}: must be within {low}..={high}")]
    OutOfRange {
        /// Text as given.
        text: String,
        /// Lowest valid value.
        low: i128,
        /// Highest valid value.
        high: i128,
    },
    /// Wrong number of bytes.
    #[error("{bytes} bytes do not match {data_type}")]
    Length {
        /// Number of bytes.
        bytes: usize,
        /// Expected type.
        data_type: GatewayType,
    },
}

/// Decoded value.
#[derive(Clone, Debug, Display, PartialEq)]
pub enum Value {
    /// BOOLEAN, shown as `0` or `1`.
    #[display("{}", u8::from(*_0))]
    Boolean(bool),
    /// INTEGER or UNSIGNED, shown in decimal.
    #[display("{_0}")]
    Whole(i128),
    /// Unsigned integer, shown in hexadecimal.
    #[display("0x{_0:0digits$X}", digits = _1.bytes() * 2)]
    Pattern(u64, Width),
    /// Floating-point number of 32 bits.
    #[display("{_0}")]
    Real32(f32),
    /// Floating-point number of 64 bits.
    #[display("{_0}")]
    Real64(f64),
    /// VISIBLE_STRING or UNICODE_STRING.
    #[display("{_0}")]
    Text(String),
    /// OCTET_STRING or DOMAIN.
    #[display("{}", Octets(_0))]
    Bytes(Vec<u8>),
    /// Time of day or time difference.
    #[display("{}:{}", _0.days, _0.millis)]
    Time(TimeOfDay),
}

impl GatewayType {
    /// Parses a text.
    ///
    /// # Errors
    /// Returns an error if the text is not a value of the type.
    pub fn parse(self, text: &str) -> Result<Value, ValueError> {
        let malformed = |expected| ValueError::Malformed { text: text.to_owned(), expected };
        match self {
            Self::Boolean => match text {
                "0" | "false" => Ok(Value::Boolean(false)),
                "1" | "true" => Ok(Value::Boolean(true)),
                _ => Err(malformed("0, 1, false or true")),
            },
            Self::Signed(_) | Self::Unsigned(_) => {
                let number = whole(text).ok_or_else(|| malformed("a whole number"))?;
                self.within(text, number).map(Value::Whole)
            }
            Self::Hexadecimal(width) => {
                let number = hexadecimal(bare(text));
                let number = number.ok_or_else(|| malformed("a hexadecimal number"))?;
                let number = self.within(text, number)?;
                Ok(Value::Pattern(u64::try_from(number).unwrap_or(u64::MAX), width))
            }
            Self::Real32 => {
                let number = text.parse().ok().filter(|number: &f32| number.is_finite());
                number.map(Value::Real32).ok_or_else(|| malformed("a number of 32 bits"))
            }
            Self::Real64 => {
                let number = text.parse().ok().filter(|number: &f64| number.is_finite());
                number.map(Value::Real64).ok_or_else(|| malformed("a number of 64 bits"))
            }
            Self::VisibleString => {
                let is_visible = text.bytes().all(|byte| matches!(byte, 0x20..=0x7E));
                is_visible
                    .then(|| Value::Text(text.to_owned()))
                    .ok_or_else(|| malformed("text of visible ASCII characters"))
            }
            Self::UnicodeString => Ok(Value::Text(text.to_owned())),
            Self::OctetString | Self::Domain => {
                octets(text).map(Value::Bytes).ok_or_else(|| malformed("hexadecimal bytes"))
            }
            Self::TimeOfDay | Self::TimeDifference => time(text)
                .map(Value::Time)
                .ok_or_else(|| malformed("DAYS:MILLISECONDS, of 16 and 28 bits")),
        }
    }

    fn within(self, text: &str, number: i128) -> Result<i128, ValueError> {
        let (low, high) = self.range().unwrap_or((i128::MIN, i128::MAX));
        within(text, number, low, high)
    }

    /// Decodes the content of an object.
    ///
    /// # Errors
    /// Returns an error for a wrong length.
    pub fn decode(self, bytes: &[u8]) -> Result<Value, ValueError> {
        let length = || ValueError::Length { bytes: bytes.len(), data_type: self };
        if self.size().is_some_and(|size| size != bytes.len()) {
            return Err(length());
        }
        let number =
            || bytes.iter().rev().fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
        Ok(match self {
            Self::Boolean => Value::Boolean(number() != 0),
            Self::Unsigned(_) => Value::Whole(i128::from(number())),
            Self::Hexadecimal(width) => Value::Pattern(number(), width),
            Self::Signed(width) => {
                let number = i128::from(number());
                let is_negative = number >> (width.bits() - 1) != 0;
                Value::Whole(if is_negative { number - (1 << width.bits()) } else { number })
            }
            Self::Real32 => {
                Value::Real32(f32::from_le_bytes(bytes.try_into().map_err(|_| length())?))
            }
            Self::Real64 => {
                Value::Real64(f64::from_le_bytes(bytes.try_into().map_err(|_| length())?))
            }
            Self::VisibleString => Value::Text(visible(bytes)),
            Self::UnicodeString => {
                let (units, rest) = bytes.as_chunks::<2>();
                if !rest.is_empty() {
                    return Err(length());
                }
                let units: Vec<u16> = units.iter().map(|unit| u16::from_le_bytes(*unit)).collect();
                Value::Text(String::from_utf16_lossy(&units))
            }
            Self::OctetString | Self::Domain => Value::Bytes(bytes.to_vec()),
            Self::TimeOfDay | Self::TimeDifference => {
                Value::Time(TimeOfDay::decode(bytes).ok_or_else(length)?)
            }
        })
    }

    /// Encodes a value of this type, as returned by [`parse`](Self::parse) or [`decode`](Self::decode).
    pub fn encode(self, value: &Value) -> Vec<u8> {
        match value {
            Value::Boolean(is) => vec![u8::from(*is)],
            Value::Whole(number) => sized(&number.to_le_bytes(), self.size()),
            Value::Pattern(number, width) => sized(&number.to_le_bytes(), Some(width.bytes())),
            Value::Real32(number) => number.to_le_bytes().to_vec(),
            Value::Real64(number) => number.to_le_bytes().to_vec(),
            Value::Text(text) if self == Self::UnicodeString => {
                text.encode_utf16().flat_map(u16::to_le_bytes).collect()
            }
            Value::Text(text) => text.as_bytes().to_vec(),
            Value::Bytes(bytes) => bytes.clone(),
            Value::Time(time) => time.bytes().to_vec(),
        }
    }
}

/// Bytes in hexadecimal: `01 AB FF`
#[derive(Clone, Copy, Debug)]
pub struct Octets<'a>(pub &'a [u8]);

impl fmt::Display for Octets<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, byte) in self.0.iter().enumerate() {
            let gap = if place == 0 { "" } else { " " };
            write!(f, "{gap}{byte:02X}")?;
        }
        Ok(())
    }
}

/// Returns the number if it is within its limits, ends included.
///
/// # Errors
/// Returns an error with `text` otherwise.
pub fn within(text: &str, number: i128, low: i128, high: i128) -> Result<i128, ValueError> {
    if (low..=high).contains(&number) {
        Ok(number)
    } else {
        Err(ValueError::OutOfRange { text: text.to_owned(), low, high })
    }
}

/// Parses pairs of hexadecimal digits, with or without blanks.
fn octets(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    for word in text.split_ascii_whitespace() {
        let word = word.strip_prefix("0x").unwrap_or(word);
        let (pairs, rest) = word.as_bytes().as_chunks::<2>();
        if !rest.is_empty() {
            return None;
        }
        for pair in pairs {
            bytes.push(candump::byte(*pair)?);
        }
    }
    Some(bytes)
}

fn time(text: &str) -> Option<TimeOfDay> {
    const MAX_MILLIS: u32 = (1 << 28) - 1;
    let (days, millis) = text.split_once(':')?;
    let millis = millis.parse().ok().filter(|millis| *millis <= MAX_MILLIS)?;
    Some(TimeOfDay { days: days.parse().ok()?, millis })
}

/// Decodes a text up to its first zero; replaces characters that are not visible ASCII.
pub fn visible(bytes: &[u8]) -> String {
    let text = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    let show = |byte: &u8| if matches!(byte, 0x20..=0x7E) { char::from(*byte) } else { '\u{FFFD}' };
    text.iter().map(show).collect()
}

fn sized(bytes: &[u8], size: Option<usize>) -> Vec<u8> {
    bytes.get(..size.unwrap_or(bytes.len())).unwrap_or(bytes).to_vec()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::value::gateway_type::names;

    fn bytes(data_type: &str, text: &str) -> Result<Vec<u8>, String> {
        let data_type: GatewayType = data_type.parse().unwrap();
        let value = data_type.parse(text).map_err(|error| error.to_string())?;
        Ok(data_type.encode(&value))
    }

    #[test]
    fn texts_are_encoded() {
        for (data_type, text, expected) in [
            ("b", "true", vec![1]),
            ("u8", "255", vec![255]),
            ("u16", "0x6071", vec![0x71, 0x60]),
            ("u16", "6071h", vec![0x71, 0x60]),
            ("i16", "-1000", vec![0x18, 0xFC]),
            ("i24", "-1", vec![0xFF; 3]),
            ("i64", "-9223372036854775808", vec![0, 0, 0, 0, 0, 0, 0, 0x80]),
            ("u64", "18446744073709551615", vec![0xFF; 8]),
            ("x32", "DEADBEEF", vec![0xEF, 0xBE, 0xAD, 0xDE]),
            ("x16", "0x0F", vec![0x0F, 0]),
            ("r32", "1.5", vec![0, 0, 0xC0, 0x3F]),
            ("r64", "-2", vec![0, 0, 0, 0, 0, 0, 0, 0xC0]),
            ("vs", "a b", b"a b".to_vec()),
            ("us", "é", vec![0xE9, 0]),
            ("os", "01 aB ff", vec![1, 0xAB, 0xFF]),
            ("d", "01abFF", vec![1, 0xAB, 0xFF]),
            ("d", "", vec![]),
            ("t", "1:2", vec![2, 0, 0, 0, 1, 0]),
        ] {
            assert_eq!(bytes(data_type, text), Ok(expected), "{data_type} {text}");
        }
    }

    #[test]
    fn invalid_values_are_refused() {
        for (data_type, text, reason) in [
            ("u8", "256", "256: must be within 0..=255"),
            ("u8", "-1", "-1: must be within 0..=255"),
            ("i16", "0xFFFF", "0xFFFF: must be within -32768..=32767"),
            ("i16", "1e3", "1e3: not a whole number"),
            ("i16", "", ": not a whole number"),
            ("i16", "--1", "--1: not a whole number"),
            (
                "u64",
                "0x10000000000000000",
                "0x10000000000000000: must be within 0..=18446744073709551615",
            ),
            ("x8", "100", "100: must be within 0..=255"),
            ("b", "2", "2: not 0, 1, false or true"),
            ("r32", "1e39", "1e39: not a number of 32 bits"),
            ("r64", "nan", "nan: not a number of 64 bits"),
            ("vs", "é", "é: not text of visible ASCII characters"),
            ("os", "123", "123: not hexadecimal bytes"),
            ("os", "0g", "0g: not hexadecimal bytes"),
            ("t", "1", "1: not DAYS:MILLISECONDS, of 16 and 28 bits"),
            ("t", "1:268435456", "1:268435456: not DAYS:MILLISECONDS, of 16 and 28 bits"),
        ] {
            assert_eq!(bytes(data_type, text), Err(reason.to_owned()), "{data_type} {text}");
        }
    }

    #[test]
    fn text_ends_at_zero_and_replaces_invisible_characters() {
        let read =
            |data_type: GatewayType, bytes: &[u8]| data_type.decode(bytes).unwrap().to_string();
        assert_eq!(read(GatewayType::VisibleString, b"motor\0\0\0"), "motor");
        assert_eq!(read(GatewayType::VisibleString, b"a\x1B[31m"), "a\u{FFFD}[31m", "no escapes");
        let mismatch = GatewayType::UnicodeString.decode(&[1, 2, 3]).unwrap_err();
        assert_eq!(mismatch.to_string(), "3 bytes do not match us");
    }

    proptest! {
        #[test]
        fn displayed_values_parse_to_the_same_bytes(
            name in prop::sample::select(names()),
            random in proptest::collection::vec(any::<u8>(), 0..20),
        ) {
            let data_type: GatewayType = name.parse().unwrap();
            let mut bytes = random;
            if let Some(size) = data_type.size() {
                bytes.resize(size, 0xA5);
            }
            if data_type == GatewayType::Boolean {
                bytes[0] &= 1;
            }
            if let Ok(value) = data_type.decode(&bytes) {
                let is_text = matches!(data_type, GatewayType::VisibleString | GatewayType::UnicodeString);
                let is_finite = match value {
                    Value::Real32(number) => number.is_finite(),
                    Value::Real64(number) => number.is_finite(),
                    Value::Boolean(_) | Value::Whole(_) | Value::Pattern(..) | Value::Text(_)
                    | Value::Bytes(_) | Value::Time(_) => true,
                };
                if let Value::Time(_) = value {
                    bytes[3] &= 0x0F;
                }
                if !is_text && is_finite {
                    let again = data_type.parse(&value.to_string()).unwrap();
                    prop_assert_eq!(data_type.encode(&again), bytes);
                }
            }
        }

        #[test]
        fn any_text_is_encoded_to_the_right_size_or_refused(
            name in prop::sample::select(names()),
            text in "\\PC{0,24}|-?[0-9a-fx:. ]{0,24}",
        ) {
            let data_type: GatewayType = name.parse().unwrap();
            if let Ok(value) = data_type.parse(&text) {
                let bytes = data_type.encode(&value);
                prop_assert!(data_type.size().is_none_or(|size| size == bytes.len()));
            }
        }
    }
}
