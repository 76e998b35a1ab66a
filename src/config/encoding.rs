//! Text of a file: UTF-8, or what the file seems to be instead.

use std::str;

use thiserror::Error;

/// Byte order marks of UTF-16, little and big endian.
const MARKS_OF_UTF_16: [[u8; 2]; 2] = [[0xFF, 0xFE], [0xFE, 0xFF]];

/// Content that is not text in UTF-8.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{encoding}")]
pub struct NotText {
    /// Line, from 1.
    pub line: usize,
    /// Apparent encoding.
    pub encoding: Encoding,
}

/// Apparent encoding of a content that is not text in UTF-8.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Encoding {
    /// UTF-16, by its byte order mark.
    #[error("is UTF-16, by its byte order mark: save the file as UTF-8")]
    Utf16,
    /// UTF-16 without a byte order mark, as every other byte is zero.
    #[error("seems to be UTF-16 without a byte order mark: save the file as UTF-8")]
    UnmarkedUtf16,
    /// One byte for each character, with this one above 7Fh.
    #[error(
        "byte {0:02X}h is not UTF-8; the file seems to be Latin-1 or Windows-1252: save it as UTF-8"
    )]
    Latin1(u8),
    /// No text, with this byte.
    #[error("byte {0:02X}h is not text: it seems to be a binary file")]
    Binary(u8),
}

/// Returns the content as text.
///
/// # Errors
/// When it is not UTF-8, or has a byte zero.
pub fn decode(content: &[u8]) -> Result<&str, NotText> {
    if MARKS_OF_UTF_16.iter().any(|mark| content.starts_with(mark)) {
        return Err(NotText { line: 1, encoding: Encoding::Utf16 });
    }
    let text = str::from_utf8(content);
    let zero = content.iter().position(|byte| *byte == 0);
    let invalid = text.err().map(|error| error.valid_up_to());
    let Some(wrong) = zero.into_iter().chain(invalid).min() else {
        return Ok(text.unwrap_or_default());
    };
    let line = 1 + content.iter().take(wrong).filter(|byte| **byte == b'\n').count();
    let encoding = encoding(content, content.get(wrong).copied().unwrap_or_default());
    Err(NotText { line, encoding })
}

/// Returns the apparent encoding of a content in which `wrong` is the first wrong byte.
fn encoding(content: &[u8], wrong: u8) -> Encoding {
    let zeros = content.iter().filter(|byte| **byte == 0).count();
    if zeros * 5 > content.len() * 2 && zeros * 5 < content.len() * 3 {
        Encoding::UnmarkedUtf16
    } else if content.iter().any(is_control) {
        Encoding::Binary(wrong)
    } else {
        Encoding::Latin1(wrong)
    }
}

/// Returns whether a byte is a control character that no text has.
const fn is_control(byte: &u8) -> bool {
    matches!(*byte, 0..=8 | 0x0E..=0x1F | 0x7F)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn refused(content: &[u8]) -> (usize, String) {
        let wrong = decode(content).unwrap_err();
        (wrong.line, wrong.to_string())
    }

    fn utf_16(text: &str) -> Vec<u8> {
        text.encode_utf16().flat_map(u16::to_le_bytes).collect()
    }

    #[test]
    fn content_that_is_not_utf_8_is_named_with_its_line() {
        let latin =
            "byte E4h is not UTF-8; the file seems to be Latin-1 or Windows-1252: save it as UTF-8";
        assert_eq!(refused(b"a = 1\n# H\xE4nd\n"), (2, latin.to_owned()));
        let unmarked = utf_16("a = 1\nb = 2\n");
        let marked = [&[0xFF, 0xFE], &unmarked[..]].concat();
        let by_mark = "is UTF-16, by its byte order mark: save the file as UTF-8";
        assert_eq!(refused(&marked), (1, by_mark.to_owned()));
        let without = "seems to be UTF-16 without a byte order mark: save the file as UTF-8";
        assert_eq!(refused(&unmarked), (1, without.to_owned()));
        let binary = "byte FEh is not text: it seems to be a binary file";
        assert_eq!(refused(b"\x7FELF\n\n\xFE\x01\x02"), (3, binary.to_owned()));
        assert_eq!(refused(b"a = 1\n\0").0, 2);
    }

    proptest! {
        #[test]
        fn text_without_zero_bytes_is_itself(text in "[^\0]*") {
            prop_assert_eq!(decode(text.as_bytes()), Ok(text.as_str()));
        }

        #[test]
        fn any_content_is_text_or_refused(content in proptest::collection::vec(any::<u8>(), 0..200)) {
            if let Err(wrong) = decode(&content) {
                prop_assert!(wrong.line <= 201);
            }
        }
    }
}
