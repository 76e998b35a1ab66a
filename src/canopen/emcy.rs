//! Emergency messages (EMCY, CiA 301, 7.2.7) and their text.
//!
//! `node::safety` decides the reaction of the node.
//!
//! | byte | meaning                              |
//! |------|--------------------------------------|
//! | 0–1  | error code                           |
//! | 2    | error register (1001h)               |
//! | 3–7  | manufacturer-specific                 |

use std::fmt;

use canopen_rs::emcy::emcy_cob_id;
use canopen_rs::{EmergencyMessage, NodeId};

use crate::error_codes;

/// COB-ID of the predefined connection set, 80h + node-id.
pub const fn default_cob_id(node: NodeId) -> u16 {
    emcy_cob_id(node)
}

/// COB-ID with lower priority than all PDOs, 680h + node-id; `None` if that is restricted (CiA 301, 7.3.5).
pub fn low_cob_id(node: NodeId) -> Option<u16> {
    (node.raw() < 0x60).then(|| 0x680 + u16::from(node.raw()))
}

/// Content of an EMCY message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code; 0000h is an error reset.
    pub code: u16,
    /// Error register (1001h): classes of all present errors.
    pub register: u8,
    /// Manufacturer-specific bytes.
    pub manufacturer: [u8; 5],
}

impl Emergency {
    /// Decodes the eight bytes; `None` for another length.
    pub fn decode(data: &[u8]) -> Option<Self> {
        let message = EmergencyMessage::decode(data).ok()?;
        Some(Self {
            code: message.error_code,
            register: message.error_register.0,
            manufacturer: message.vendor_specific,
        })
    }

    /// Returns whether the message is an error reset.
    pub const fn is_reset(&self) -> bool {
        self.code == 0
    }

    /// Returns whether the message reports no present error (register 0), with one of these codes.
    pub fn is_warning(&self, codes: &[u16]) -> bool {
        self.register == 0 && codes.contains(&self.code)
    }

    /// Text of the error code, or of its class if the code is unknown.
    pub fn description(&self) -> &'static str {
        error_codes::description(self.code)
    }
}

/// `3210h DC link over-voltage (voltage) 01 00 00 00 00`: code, classes in the error register, manufacturer's
/// bytes. Zero fields are omitted.
impl fmt::Display for Emergency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h {}", self.code, self.description())?;
        for (place, class) in error_codes::classes(self.register).enumerate() {
            let separator = if place == 0 { " (" } else { ", " };
            write!(f, "{separator}{class}")?;
        }
        if self.register != 0 {
            f.write_str(")")?;
        }
        if self.manufacturer != [0; 5] {
            self.manufacturer.iter().try_for_each(|byte| write!(f, " {byte:02X}"))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bytes_read_as_a_sentence() {
        let emergency = Emergency::decode(&[0x10, 0x32, 0x04, 1, 0, 0, 0, 0]).unwrap();
        assert_eq!(emergency.to_string(), "3210h DC link over-voltage (voltage) 01 00 00 00 00");
        let emergency = Emergency::decode(&[0x50, 0x82, 0x11, 0, 0, 0, 0, 0]).unwrap();
        assert_eq!(emergency.to_string(), "8250h RPDO timeout (generic, communication)");
    }

    #[test]
    fn error_reset_reads_as_such() {
        let reset = Emergency::decode(&[0; 8]).unwrap();
        assert!(reset.is_reset());
        assert_eq!(reset.to_string(), "0000h error reset");
    }

    #[test]
    fn other_lengths_are_invalid() {
        for length in (0..8).chain(9..12) {
            assert_eq!(Emergency::decode(&vec![0; length]), None);
        }
    }
}
