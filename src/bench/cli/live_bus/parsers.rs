//! Parsers of objects and numbers on the command line.

use canopen::object::Object;
use canopen_tools::value::numeral::{hexadecimal, whole};

/// Parses an object. The index is hexadecimal: `6041`, `0x6041`, `6041h`. The sub-index defaults to 0; it is decimal
/// or as `0x1F` in `6041:0`, hexadecimal in the EDS notation `1A00sub1`.
pub(crate) fn object(text: &str) -> Result<Object, String> {
    let wrong = || "expected INDEX or INDEX:SUB, as 6041 or 1018:4".to_owned();
    let lower = text.to_ascii_lowercase();
    let (index, sub) = match (lower.split_once(':'), lower.split_once("sub")) {
        (Some((index, sub)), _) => (index, whole(sub).ok_or_else(wrong)?),
        (None, Some((index, sub))) => (index, hexadecimal(sub).ok_or_else(wrong)?),
        (None, None) => (lower.as_str(), 0),
    };
    let bare = index.strip_prefix("0x").unwrap_or(index.strip_suffix('h').unwrap_or(index));
    let index = hexadecimal(bare).and_then(|index| u16::try_from(index).ok());
    let index = index.ok_or_else(wrong)?;
    Ok(Object { index, sub: u8::try_from(sub).map_err(|_| wrong())? })
}

/// Parses an unsigned 32-bit number: `7`, `0x402`, `402h`.
pub(crate) fn number(text: &str) -> Result<u32, String> {
    let number = whole(text).and_then(|number| u32::try_from(number).ok());
    number.ok_or_else(|| "must be an unsigned 32-bit number".to_owned())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn object_notations_are_equivalent() {
        for (text, index, sub) in [
            ("6041", 0x6041, 0),
            ("0x6041", 0x6041, 0),
            ("6041h", 0x6041, 0),
            ("6041H:0", 0x6041, 0),
            ("1018:4", 0x1018, 4),
            ("1018h:4", 0x1018, 4),
            ("0x1A00:0x1F", 0x1A00, 31),
            ("1a00:10", 0x1A00, 10),
            ("1A00sub1", 0x1A00, 1),
            ("1A00subA", 0x1A00, 10),
            ("1003:1Fh", 0x1003, 31),
        ] {
            assert_eq!(object(text), Ok(Object { index, sub }), "{text}");
        }
        for text in [
            "",
            ":",
            "6041:",
            "6041:256",
            "16041",
            "604G",
            "+6041",
            "1A00sub",
            "1A00sub1FF",
            "6041:-1",
        ] {
            assert!(object(text).is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_parses_or_fails_and_objects_round_trip(text in "\\PC{0,12}|[0-9a-fhxsub:]{0,12}") {
            if let Ok(found) = object(&text) {
                prop_assert_eq!(object(&found.to_string()), Ok(found));
            }
        }
    }
}
