//! Plain little-endian CDR (OMG DDS-XTypes 1.3, 7.4), with the encapsulation header that ROS 2 writes before it.

use byteorder::LittleEndian;
use serde::Serialize;

/// Encapsulation header: plain CDR, little-endian, no options. Alignment counts from behind it.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Replaces `buffer` by an encoded message.
///
/// # Errors
/// Returns an error for a type that CDR does not have, or a sequence of more than 2³² elements.
pub(crate) fn encode(
    buffer: &mut Vec<u8>,
    message: &impl Serialize,
) -> Result<(), cdr_encoding::Error> {
    buffer.clear();
    buffer.extend_from_slice(&ENCAPSULATION);
    cdr_encoding::to_writer::<_, LittleEndian, _>(buffer, message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Header, ScrewStamped, Time};
    use units::spatial::Wrench;

    #[test]
    fn numbers_are_aligned_behind_the_header_of_four_bytes() {
        let stamp = Time::from_nanos(1_500_000_000_000_000_007);
        let header = Header { stamp, frame_id: "mrf" };
        let wrench = Wrench::from_components([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let mut bytes = vec![7; 3];
        encode(&mut bytes, &ScrewStamped { header, screw: wrench.into() }).unwrap();
        // Stamp, length and text of the frame end at 16 bytes, a multiple of eight.
        assert_eq!(bytes.len(), 4 + 16 + 48);
        assert_eq!(bytes[..8], [0, 1, 0, 0, 0x00, 0x2F, 0x68, 0x59]);
        assert_eq!(bytes[8..20], [7, 0, 0, 0, 4, 0, 0, 0, b'm', b'r', b'f', 0]);
        assert_eq!(bytes[20..28], 1.0_f64.to_le_bytes());
        assert_eq!(bytes[60..], 6.0_f64.to_le_bytes());
    }
}
