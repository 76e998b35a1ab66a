//! Values in an EDS (CiA 306, 4.2): numbers, formulas with the node-id, texts, bytes.

use thiserror::Error;

use crate::NodeId;
use crate::data_type::{DataType, Kind};

/// Number, optionally plus the node-id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// Value without the node-id.
    pub value: i128,
    /// Set if the node-id is added.
    pub plus_node_id: bool,
}

impl Number {
    /// Resolves the number for one node.
    pub fn resolve(self, node: NodeId) -> i128 {
        let base = if self.plus_node_id { i128::from(node.raw()) } else { 0 };
        self.value.saturating_add(base)
    }
}

/// Error of a text that is not a value of its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NoValue {
    /// Not a decimal, hexadecimal or octal number.
    #[error("not a number")]
    NotANumber,
    /// `$NODEID` with an invalid number.
    #[error("not $NODEID plus a number")]
    NotASum,
    /// Out of range of the type.
    #[error("does not fit {0}")]
    TooLarge(&'static str),
    /// Not a floating-point number.
    #[error("neither a floating-point number nor its bits in hexadecimal")]
    NotReal,
    /// Not a valid byte string.
    #[error("not bytes in hexadecimal")]
    NotBytes,
    /// Not representable in Latin-1.
    #[error("has characters that are not in Latin-1")]
    NotLatin1,
}

/// Radix of an integer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Radix {
    /// `31`; also `08`, which cannot be octal.
    Decimal,
    /// `0x1F`.
    Hexadecimal,
    /// `037`, as in C.
    Octal,
}

/// Parses an integer, with or without a sign.
pub(super) fn whole(text: &str) -> Option<(i128, Radix)> {
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let is_octal = |digit: &u8| (b'0'..=b'7').contains(digit);
    let (radix, base, digits) = match unsigned.as_bytes() {
        [b'0', b'x' | b'X', ..] => (Radix::Hexadecimal, 16, unsigned.get(2..)?),
        [b'0', _, ..] if unsigned.as_bytes().iter().all(is_octal) => (Radix::Octal, 8, unsigned),
        _ => (Radix::Decimal, 10, unsigned),
    };
    let is_number = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let value = is_number.then(|| i128::from_str_radix(digits, base).ok()).flatten()?;
    Some((sign * value, radix))
}

/// Parses a number of an integer type or BOOLEAN. Hexadecimal bits of a negative number are accepted: `0xFFFF`
/// of INTEGER16 is -1.
///
/// # Errors
/// Returns an error for other texts, and for numbers out of range.
pub fn number(text: &str, data_type: &DataType) -> Result<Number, NoValue> {
    if data_type.kind == Kind::Boolean {
        let is = |word: &str| text.eq_ignore_ascii_case(word);
        if is("true") || is("false") {
            return Ok(Number { value: i128::from(is("true")), plus_node_id: false });
        }
    }
    let (value, radix, plus_node_id) = sum(text)?;
    let too_large = NoValue::TooLarge(data_type.name);
    let (Some(range), Some(bits)) = (data_type.range(), data_type.bits) else {
        return Err(too_large);
    };
    let is_bits = radix == Radix::Hexadecimal && value > *range.end() && value >> bits == 0;
    let value = if is_bits && data_type.kind == Kind::Signed { value - (1 << bits) } else { value };
    let largest = if plus_node_id { value.saturating_add(LAST_NODE_ID) } else { value };
    if range.contains(&value) && range.contains(&largest) {
        Ok(Number { value, plus_node_id })
    } else {
        Err(too_large)
    }
}

/// Maximum node-id.
const LAST_NODE_ID: i128 = 127;

/// Name of the variable after `$`.
const VARIABLE: &str = "NODEID";

/// Parses a number, with `$NODEID` before or after it; returns whether it was present.
fn sum(text: &str) -> Result<(i128, Radix, bool), NoValue> {
    let Some((before, behind)) = text.split_once('$') else {
        let (value, radix) = whole(text).ok_or(NoValue::NotANumber)?;
        return Ok((value, radix, false));
    };
    let (name, behind) = behind.split_at_checked(VARIABLE.len()).ok_or(NoValue::NotASum)?;
    if !name.eq_ignore_ascii_case(VARIABLE) {
        return Err(NoValue::NotASum);
    }
    let (before, behind) = (before.trim(), behind.trim());
    let rest = match (before.strip_suffix('+'), behind.strip_prefix('+')) {
        (None, None) if before.is_empty() && behind.is_empty() => "0",
        (None, None) if before.is_empty() && behind.starts_with('-') => behind,
        (None, Some(number)) if before.is_empty() => number,
        (Some(number), None) if behind.is_empty() => number,
        _ => return Err(NoValue::NotASum),
    };
    let (value, radix) = whole(rest.trim()).ok_or(NoValue::NotASum)?;
    Ok((value, radix, true))
}

/// Encodes a value for `node`, little-endian.
///
/// # Errors
/// Returns an error if the text is not a value of the type.
pub(super) fn bytes(text: &str, data_type: &DataType, node: NodeId) -> Result<Vec<u8>, NoValue> {
    let word = text.split_once(';').map_or(text, |(word, _)| word.trim_end());
    match data_type.kind {
        Kind::Boolean | Kind::Signed | Kind::Unsigned => {
            let number = number(word, data_type)?.resolve(node).to_le_bytes();
            Ok(number.get(..data_type.bytes().unwrap_or(0)).unwrap_or_default().to_vec())
        }
        Kind::Real => real(word, data_type).ok_or(NoValue::NotReal),
        Kind::Text => {
            text.chars().map(u8::try_from).collect::<Result<_, _>>().map_err(|_| NoValue::NotLatin1)
        }
        Kind::UnicodeText => Ok(text.encode_utf16().flat_map(u16::to_le_bytes).collect()),
        Kind::Octets => octets(word).ok_or(NoValue::NotBytes),
    }
}

/// Parses a floating-point number or its bits.
fn real(text: &str, data_type: &DataType) -> Option<Vec<u8>> {
    let bits = match whole(text) {
        Some((bits, Radix::Hexadecimal)) => Some(u64::try_from(bits).ok()?),
        Some(_) | None => None,
    };
    if data_type.bits == Some(32) {
        let bits = bits.map(u32::try_from).transpose().ok()?;
        let number = bits.map_or_else(|| text.parse().ok(), |bits| Some(f32::from_bits(bits)))?;
        Some(number.to_le_bytes().to_vec())
    } else {
        let number = bits.map_or_else(|| text.parse().ok(), |bits| Some(f64::from_bits(bits)))?;
        Some(number.to_le_bytes().to_vec())
    }
}

/// Parses pairs of hexadecimal digits, with optional blanks and prefix `0x`.
fn octets(text: &str) -> Option<Vec<u8>> {
    let digits = text.strip_prefix("0x").or(text.strip_prefix("0X")).unwrap_or(text);
    let digits: Vec<u8> = digits.bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
    let (pairs, rest) = digits.as_chunks::<2>();
    let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    let byte = |[high, low]: &[u8; 2]| Some(digit(*high)? << 4 | digit(*low)?);
    rest.is_empty().then(|| pairs.iter().map(byte).collect()).flatten()
}

/// Formats bytes as a value of a type: signed numbers in decimal, others in hexadecimal. `None` if they are not
/// a value of the type.
pub fn text(bytes: &[u8], data_type: &DataType) -> Option<String> {
    if data_type.bytes().is_some_and(|size| size != bytes.len()) {
        return None;
    }
    Some(match data_type.kind {
        Kind::Boolean => u8::from(bytes != [0]).to_string(),
        Kind::Unsigned => hexadecimal(bytes.iter().rev()),
        Kind::Signed => signed(bytes).to_string(),
        Kind::Real => real_text(bytes)?,
        Kind::Text => bytes.iter().copied().map(char::from).collect(),
        Kind::UnicodeText => {
            let (units, _) = bytes.as_chunks::<2>();
            String::from_utf16_lossy(
                &units.iter().map(|unit| u16::from_le_bytes(*unit)).collect::<Vec<_>>(),
            )
        }
        Kind::Octets => bytes.iter().map(|byte| format!("{byte:02X}")).collect(),
    })
}

/// Formats a finite number in decimal, any other by its bits.
fn real_text(bytes: &[u8]) -> Option<String> {
    let (text, is_finite) = match *bytes {
        [a, b, c, d] => {
            let number = f32::from_le_bytes([a, b, c, d]);
            (number.to_string(), number.is_finite())
        }
        [a, b, c, d, e, f, g, h] => {
            let number = f64::from_le_bytes([a, b, c, d, e, f, g, h]);
            (number.to_string(), number.is_finite())
        }
        _ => return None,
    };
    Some(if is_finite { text } else { hexadecimal(bytes.iter().rev()) })
}

/// Formats a number in hexadecimal, most significant digit first.
fn hexadecimal<'b>(bytes: impl Iterator<Item = &'b u8>) -> String {
    bytes.fold("0x".to_owned(), |digits, byte| format!("{digits}{byte:02X}"))
}

/// Decodes a two's complement number of up to 16 bytes, little-endian.
pub fn signed(bytes: &[u8]) -> i128 {
    let is_negative = bytes.last().is_some_and(|high| *high & 0x80 != 0);
    extended(bytes, if is_negative { 0xFF } else { 0 })
}

/// Decodes an unsigned number of up to 15 bytes, little-endian.
pub fn unsigned(bytes: &[u8]) -> i128 {
    extended(bytes, 0)
}

fn extended(bytes: &[u8], fill: u8) -> i128 {
    let mut number = [fill; 16];
    for (to, from) in number.iter_mut().zip(bytes) {
        *to = *from;
    }
    i128::from_le_bytes(number)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::data_type;

    fn numbered(number: u16) -> DataType {
        data_type::find(number).unwrap()
    }

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    #[test]
    fn numbers_of_real_files_are_parsed() {
        for (text, value) in [
            ("0x1F", 31),
            ("0X1f", 31),
            ("31", 31),
            ("+31", 31),
            ("001", 1),
            ("037", 31),
            ("080", 80),
            ("-5", -5),
            ("-0x5", -5),
            ("0", 0),
            ("0xFFFFFFFFFFFFFFFF", i128::from(u64::MAX)),
        ] {
            assert_eq!(whole(text).map(|(value, _)| value), Some(value), "{text}");
        }
        for text in ["", "0x", "0xG", "--5", "0x-5", "1.0", "1F", "- 5", &"9".repeat(50)] {
            assert_eq!(whole(text), None, "{text}");
        }
    }

    #[test]
    fn node_id_is_accepted_on_either_side() {
        for text in
            ["$NODEID+0x180", "0x180+$NODEID", "$nodeid + 384", " 0x180 + $NodeId", "$NODEID+0600"]
        {
            let number = number(text, &numbered(7)).unwrap();
            assert_eq!((number.value, number.plus_node_id), (0x180, true), "{text}");
            assert_eq!(number.resolve(node()), 0x183);
        }
        assert_eq!(number("$NODEID", &numbered(5)).unwrap().resolve(node()), 3);
        assert_eq!(number("$NODEID-1", &numbered(3)).unwrap().resolve(node()), 2);
        for text in
            ["-$NODEID", "$NODEID 5", "2*$NODEID", "$NODEID+$NODEID", "1+$NODEID+1", "$NODEID+"]
        {
            assert_eq!(number(text, &numbered(7)), Err(NoValue::NotASum), "{text}");
        }
    }

    #[test]
    fn bits_of_a_negative_number_are_accepted() {
        let value = |text, data_type| number(text, &numbered(data_type)).map(|number| number.value);
        assert_eq!(value("0xFFFFFFFF", 4), Ok(-1));
        assert_eq!(value("0x8000", 3), Ok(-32_768));
        assert_eq!(value("0x7FFF", 3), Ok(32_767));
        assert_eq!(value("65535", 3), Err(NoValue::TooLarge("INTEGER16")));
        assert_eq!(value("0x10000", 3), Err(NoValue::TooLarge("INTEGER16")));
        assert_eq!(value("-1", 5), Err(NoValue::TooLarge("UNSIGNED8")));
        assert_eq!(value("$NODEID+0xFF", 5), Err(NoValue::TooLarge("UNSIGNED8")));
        assert_eq!([value("TRUE", 1), value("0", 1)], [Ok(1), Ok(0)]);
        assert_eq!(value("2", 1), Err(NoValue::TooLarge("BOOLEAN")));
    }

    #[test]
    fn every_type_is_encoded() {
        let bytes = |text, data_type| bytes(text, &numbered(data_type), node());
        assert_eq!(bytes("0x1234 ; why", 6), Ok(vec![0x34, 0x12]));
        assert_eq!(bytes("-2", 0x10), Ok(vec![0xFE, 0xFF, 0xFF]));
        assert_eq!(bytes("1.5", 8), Ok(1.5_f32.to_le_bytes().to_vec()));
        assert_eq!(bytes("0x3FC00000", 8), Ok(1.5_f32.to_le_bytes().to_vec()));
        assert_eq!(bytes("-2e3", 0x11), Ok((-2_000.0_f64).to_le_bytes().to_vec()));
        assert_eq!(bytes("a;°", 9), Ok(vec![b'a', b';', 0xB0]));
        assert_eq!(bytes("Ω", 9), Err(NoValue::NotLatin1));
        assert_eq!(bytes("aΩ", 0xB), Ok(vec![0x61, 0, 0xA9, 0x03]));
        assert_eq!(bytes("12 aB", 0xA), Ok(vec![0x12, 0xAB]));
        assert_eq!(bytes("123", 0xF), Err(NoValue::NotBytes));
        assert_eq!(bytes("much", 8), Err(NoValue::NotReal));
    }

    proptest! {
        #[test]
        fn formatted_values_parse_to_themselves(
            number in prop::sample::select(vec![1_u16, 2, 3, 4, 5, 6, 7, 8, 0xC, 0x10, 0x11, 0x15, 0x16, 0x1B]),
            content in prop::array::uniform8(any::<u8>()),
        ) {
            let data_type = numbered(number);
            let mut content = content[..data_type.bytes().unwrap()].to_vec();
            if data_type.kind == Kind::Boolean {
                content[0] &= 1;
            }
            let written = text(&content, &data_type).unwrap();
            prop_assert_eq!(bytes(&written, &data_type, node()), Ok(content), "{}", written);
        }

        #[test]
        fn any_text_is_parsed_or_refused(number in 0_u16..0x20, text in ".*") {
            if let Some(data_type) = data_type::find(number) {
                bytes(&text, &data_type, node()).ok();
            }
        }
    }
}
