//! Concise DCF (CiA 302-3, value of 1F22h): the writes that configure one device, in order.
//!
//! [`plan`](canopen::plan) defines the writes and their order.

use thiserror::Error;

use canopen::object::Object;

/// Write to an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Download {
    pub object: Object,
    /// Content, little-endian as in SDO.
    pub content: Vec<u8>,
}

/// Error of a malformed concise DCF.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ConciseError {
    /// Too few bytes.
    #[error("ends within write {number} of {count}")]
    Short {
        /// Number of the incomplete write, from 1; 0 is the count.
        number: u32,
        /// Number of writes at the start of the file.
        count: u32,
    },
    /// Too many bytes.
    #[error("{0} bytes follow the last write")]
    Long(usize),
}

/// Encodes the count, then each write as index, sub-index, length and content.
pub fn encode(downloads: &[Download]) -> Vec<u8> {
    let count = u32::try_from(downloads.len()).unwrap_or(u32::MAX);
    let mut bytes = count.to_le_bytes().to_vec();
    for Download { object, content } in downloads {
        bytes.extend(object.index.to_le_bytes());
        bytes.push(object.sub);
        bytes.extend(u32::try_from(content.len()).unwrap_or(u32::MAX).to_le_bytes());
        bytes.extend(content);
    }
    bytes
}

/// Decodes a concise DCF. Memory is bounded by its size.
///
/// # Errors
/// Returns an error if count or lengths do not match the bytes.
pub fn decode(bytes: &[u8]) -> Result<Vec<Download>, ConciseError> {
    let (count, mut rest) =
        bytes.split_first_chunk().ok_or(ConciseError::Short { number: 0, count: 0 })?;
    let count = u32::from_le_bytes(*count);
    let mut downloads = Vec::new();
    for number in 1..=count {
        let (download, behind) = one(rest).ok_or(ConciseError::Short { number, count })?;
        downloads.push(download);
        rest = behind;
    }
    if rest.is_empty() { Ok(downloads) } else { Err(ConciseError::Long(rest.len())) }
}

/// Decodes the first write; returns the bytes after it.
fn one(bytes: &[u8]) -> Option<(Download, &[u8])> {
    let ([i0, i1, sub, l0, l1, l2, l3], rest) = bytes.split_first_chunk()?;
    let length = usize::try_from(u32::from_le_bytes([*l0, *l1, *l2, *l3])).ok()?;
    let (content, rest) = rest.split_at_checked(length)?;
    let object = Object { index: u16::from_le_bytes([*i0, *i1]), sub: *sub };
    Some((Download { object, content: content.to_vec() }, rest))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn encoding_is_that_of_the_standard() {
        let heartbeat = Download { object: Object::PRODUCER_HEARTBEAT, content: vec![25, 0] };
        let bytes = [1, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 25, 0];
        assert_eq!(encode(std::slice::from_ref(&heartbeat)), bytes);
        assert_eq!(decode(&bytes), Ok(vec![heartbeat]));
        assert_eq!(decode(&[0; 4]), Ok(vec![]));
    }

    #[test]
    fn wrong_length_is_refused() {
        let bytes = [2, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 25, 0];
        assert_eq!(decode(&bytes), Err(ConciseError::Short { number: 2, count: 2 }));
        assert_eq!(decode(&bytes[..3]), Err(ConciseError::Short { number: 0, count: 0 }));
        assert_eq!(decode(&[0; 6]), Err(ConciseError::Long(2)));
        assert_eq!(
            decode(&[255, 255, 255, 255, 0, 0, 0, 255, 255, 255, 255]),
            Err(ConciseError::Short { number: 1, count: u32::MAX })
        );
    }

    prop_compose! {
        fn download()(
            index in any::<u16>(),
            sub in any::<u8>(),
            content in prop::collection::vec(any::<u8>(), 0..20),
        ) -> Download {
            Download { object: Object { index, sub }, content }
        }
    }

    proptest! {
        #[test]
        fn encoded_downloads_decode_to_themselves(downloads in prop::collection::vec(download(), 0..20)) {
            prop_assert_eq!(decode(&encode(&downloads)), Ok(downloads));
        }

        #[test]
        fn any_bytes_are_decoded_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            if let Ok(downloads) = decode(&bytes) {
                prop_assert_eq!(encode(&downloads), bytes);
            }
        }
    }
}
