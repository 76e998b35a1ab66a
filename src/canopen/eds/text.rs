//! Character encoding of an EDS: ASCII in CiA 306, any in real files.

use std::sync::Arc;

/// Detected encoding of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// UTF-8, including ASCII.
    Utf8,
    /// UTF-8 with a byte order mark.
    Utf8Marked,
    /// Latin-1, as the fallback; with the line of the first byte that is invalid in UTF-8.
    Latin1(usize),
    /// UTF-16 with a byte order mark.
    Utf16,
}

/// Text of a file with lines ending in `\n`.
#[derive(Clone, Debug)]
pub(super) struct Text {
    /// Characters.
    pub(super) text: Arc<str>,
    /// Detected encoding.
    pub(super) encoding: Encoding,
}

impl Text {
    /// Decodes bytes; any bytes are accepted.
    pub(super) fn decode(bytes: &[u8]) -> Self {
        let (text, encoding) = match bytes {
            [0xEF, 0xBB, 0xBF, rest @ ..] => (utf8_or_latin1(rest).0, Encoding::Utf8Marked),
            [0xFF, 0xFE, rest @ ..] => (utf16(rest, u16::from_le_bytes), Encoding::Utf16),
            [0xFE, 0xFF, rest @ ..] => (utf16(rest, u16::from_be_bytes), Encoding::Utf16),
            _ => utf8_or_latin1(bytes),
        };
        // Line ends of Windows, Unix and old Macs.
        let text =
            if text.contains('\r') { text.replace("\r\n", "\n").replace('\r', "\n") } else { text };
        Self { text: text.into(), encoding }
    }
}

fn utf8_or_latin1(bytes: &[u8]) -> (String, Encoding) {
    match std::str::from_utf8(bytes) {
        Ok(text) => (text.to_owned(), Encoding::Utf8),
        Err(error) => {
            let text: String = bytes.iter().copied().map(char::from).collect();
            let before = bytes.get(..error.valid_up_to()).unwrap_or_default();
            (text, Encoding::Latin1(1 + line_ends(before)))
        }
    }
}

/// Number of line ends of any kind.
fn line_ends(bytes: &[u8]) -> usize {
    let next = bytes.iter().skip(1).map(Some).chain([None]);
    let ends = bytes.iter().zip(next);
    ends.filter(|(byte, next)| **byte == b'\n' || (**byte == b'\r' && *next != Some(&b'\n')))
        .count()
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let (pairs, _) = bytes.as_chunks::<2>();
    let characters = char::decode_utf16(pairs.iter().map(|pair| unit(*pair)));
    characters.map(|found| found.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

/// Encodes the text of a file for [`Eds::parse`](super::Eds::parse): ASCII, or Latin-1 where that is unambiguous, else UTF-8.
pub fn encode(text: String) -> Vec<u8> {
    if text.is_ascii() {
        return text.into_bytes();
    }
    let latin1: Option<Vec<u8>> =
        text.chars().map(|character| u8::try_from(character).ok()).collect();
    match latin1 {
        Some(bytes) if std::str::from_utf8(&bytes).is_err() => bytes,
        Some(_) | None => text.into_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(bytes: &[u8]) -> (String, Encoding) {
        let Text { text, encoding } = Text::decode(bytes);
        (text.to_string(), encoding)
    }

    #[test]
    fn every_encoding_of_a_degree_sign_is_decoded() {
        for (bytes, encoding) in [
            (&b"\xC2\xB0C"[..], Encoding::Utf8),
            (b"\xEF\xBB\xBF\xC2\xB0C", Encoding::Utf8Marked),
            (b"\xB0C", Encoding::Latin1(1)),
            (b"\xFF\xFE\xB0\0C\0", Encoding::Utf16),
            (b"\xFE\xFF\0\xB0\0C", Encoding::Utf16),
        ] {
            assert_eq!(read(bytes), ("°C".to_owned(), encoding));
        }
    }

    #[test]
    fn every_kind_of_line_end_is_accepted() {
        assert_eq!(read(b"a\r\nb\rc\nd").0, "a\nb\nc\nd");
        assert_eq!(read(b"a\r\nb\rc\n\xB0").1, Encoding::Latin1(4));
    }

    proptest! {
        #[test]
        fn encoded_texts_decode_to_themselves(text in "\\[[^\\r]*") {
            prop_assert_eq!(read(&encode(text.clone())).0, text);
        }
    }
}
