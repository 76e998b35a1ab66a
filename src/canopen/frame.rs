//! Classical CAN frame with an 11-bit identifier, the only kind CANopen uses (CiA 301, 4.2).
//!
//! The bus filters error frames, 29-bit identifiers and CAN FD frames; they never become a [`Frame`]. Remote
//! frames are only sent, for [`guarding`](crate::guarding); the bus filters received ones.

use std::fmt;

/// Largest 11-bit identifier.
pub const COB_ID_MAX: u16 = 0x7FF;

/// Bits of a COB-ID that hold the function code (CiA 301, 7.3.5); the other seven hold the node-id.
pub const FUNCTION_CODE: u16 = 0x780;

/// Maximum length of a frame as text: identifier, `#` and eight bytes.
pub const TEXT_LENGTH: usize = 20;

/// Returns both hexadecimal digits of a byte.
pub const fn hex(byte: u8) -> [u8; 2] {
    const fn digit(value: u8) -> u8 {
        if value < 10 { b'0' + value } else { b'A' + value - 10 }
    }
    [digit(byte >> 4), digit(byte & 0xF)]
}

/// Writes both hexadecimal digits of each byte into `text`, as far as it has room.
pub fn write_hex(text: &mut [u8], data: &[u8]) {
    for (pair, byte) in text.chunks_exact_mut(2).zip(data) {
        pair.copy_from_slice(&hex(*byte));
    }
}

/// CAN frame: a data frame, unless made by [`remote`](Self::remote).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    /// Identifier (COB-ID), 0 to 7FFh. The lower one wins arbitration.
    pub cob_id: u16,
    is_remote: bool,
    length: u8,
    bytes: [u8; 8],
}

impl Frame {
    /// Returns a data frame of `N` ≤ 8 bytes; a larger `N` does not compile.
    pub fn new<const N: usize>(cob_id: u16, data: [u8; N]) -> Self {
        const { assert!(N <= 8, "a classical CAN frame has at most 8 data bytes") };
        debug_assert!(cob_id <= COB_ID_MAX, "COB-IDs here are constants or predefined sets");
        let mut bytes = [0; 8];
        for (to, from) in bytes.iter_mut().zip(data) {
            *to = from;
        }
        #[expect(
            clippy::as_conversions,
            clippy::cast_possible_truncation,
            reason = "at most 8, asserted when compiled"
        )]
        let length = N as u8;
        Self { cob_id: cob_id & COB_ID_MAX, is_remote: false, length, bytes }
    }

    /// Returns a remote frame, which requests the data frame with this identifier and `length` bytes (at
    /// most 8).
    pub const fn remote(cob_id: u16, length: u8) -> Self {
        let length = if length > 8 { 8 } else { length };
        Self { cob_id: cob_id & COB_ID_MAX, is_remote: true, length, bytes: [0; 8] }
    }

    /// Returns a frame with external content; `None` for more than 11 identifier bits or 8 data bytes.
    pub fn from_slice(cob_id: u16, data: &[u8]) -> Option<Self> {
        let length = u8::try_from(data.len()).ok().filter(|length| *length <= 8)?;
        if cob_id > COB_ID_MAX {
            return None;
        }
        let mut bytes = [0; 8];
        for (to, from) in bytes.iter_mut().zip(data) {
            *to = *from;
        }
        Some(Self { cob_id, is_remote: false, length, bytes })
    }

    /// Data bytes, 0 to 8; empty for a remote frame.
    pub fn data(&self) -> &[u8] {
        let length = if self.is_remote { 0 } else { self.length };
        self.bytes.get(..usize::from(length)).unwrap_or_default()
    }

    /// Returns whether the frame requests data by its RTR bit and has none itself.
    pub const fn is_remote(&self) -> bool {
        self.is_remote
    }

    /// Writes its text as candump prints it into `text`, and returns the part written.
    pub fn text<'a>(&self, text: &'a mut [u8; TEXT_LENGTH]) -> &'a [u8] {
        let [high, low] = self.cob_id.to_be_bytes();
        let [_, third] = hex(high);
        let [second, first] = hex(low);
        let (start, rest) = text.split_at_mut(4);
        start.copy_from_slice(&[third, second, first, b'#']);
        let length = match (self.is_remote, self.length) {
            (true, requested) => {
                rest.iter_mut().zip([b'R', b'0' + requested]).for_each(|(to, from)| *to = from);
                if requested > 0 { 2 } else { 1 }
            }
            (false, length) => {
                write_hex(rest, self.data());
                2 * usize::from(length)
            }
        };
        text.get(..4 + length).unwrap_or_default()
    }

    /// Data length code, 0 to 8: of its data, or of the requested data.
    pub const fn length(&self) -> u8 {
        self.length
    }
}

/// Format of candump: `181#3700E8030000`, and `701#R1` for a remote frame of one byte.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = [0; TEXT_LENGTH];
        f.write_str(std::str::from_utf8(self.text(&mut text)).unwrap_or_default())
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Bus, as its index in the configuration's list of buses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Channel(pub u8);

/// Frame with its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Telegram {
    /// Bus.
    pub channel: Channel,
    /// Frame on this bus, received or to be sent.
    pub frame: Frame,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_reads_as_candump_prints_it() {
        assert_eq!(Frame::new(0x80, []).to_string(), "080#");
        assert_eq!(Frame::new(0x601, [0x40, 0x18, 0x10, 0x01]).to_string(), "601#40181001");
        assert_eq!(Frame::remote(0x701, 1).to_string(), "701#R1");
        assert_eq!(Frame::remote(0x701, 0).to_string(), "701#R");
    }

    #[test]
    fn remote_frame_has_a_length_and_no_data() {
        let frame = Frame::remote(0x701, 1);
        assert_eq!((frame.length(), frame.data()), (1, &[][..]));
        assert_ne!(frame, Frame::new(0x701, [0]));
    }

    #[test]
    fn oversized_content_is_refused() {
        assert_eq!(Frame::from_slice(0x800, &[]), None);
        assert_eq!(Frame::from_slice(0x181, &[0; 9]), None);
        assert_eq!(Frame::from_slice(0x181, &[1, 2]), Some(Frame::new(0x181, [1, 2])));
    }
}
