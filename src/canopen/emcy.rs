//! Emergencies (CiA 301, 7.2.7), in words.
//!
//! Only reads them. What a drive does after one is its own business, what the node does is
//! `node::safety`'s.
//!
//! | byte | meaning                              |
//! |------|--------------------------------------|
//! | 0–1  | error code                           |
//! | 2    | error register (1001h)               |
//! | 3–7  | the manufacturer's own               |

use std::fmt;

use canopen_rs::EmergencyMessage;
use canopen_rs::NodeId;
use canopen_rs::emcy::emcy_cob_id;

use crate::error_codes;

/// The COB-ID of the predefined connection set, 80h + node-id.
pub const fn default_cob_id(node: NodeId) -> u16 {
    emcy_cob_id(node)
}

/// A COB-ID behind those of all PDOs, 680h + node-id; `None` where that is restricted (CiA 301, 7.3.5).
pub fn low_cob_id(node: NodeId) -> Option<u16> {
    (node.raw() < 0x60).then(|| 0x680 + u16::from(node.raw()))
}

/// What a node reports to be wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// The error code; 0000h says that an error is gone.
    pub code: u16,
    /// The error register (1001h): the classes of all errors there are now.
    pub register: u8,
    /// Five bytes only the manufacturer can read.
    pub manufacturer: [u8; 5],
}

impl Emergency {
    /// Reads the eight bytes, `None` if there are not eight.
    pub fn decode(data: &[u8]) -> Option<Self> {
        let message = EmergencyMessage::decode(data).ok()?;
        Some(Self {
            code: message.error_code,
            register: message.error_register.0,
            manufacturer: message.vendor_specific,
        })
    }

    /// Whether this says that an error is gone, rather than there.
    pub const fn is_reset(&self) -> bool {
        self.code == 0
    }

    /// What the code says, by its class where it is not known itself.
    pub fn words(&self) -> &'static str {
        error_codes::words(self.code)
    }
}

/// `3210h DC link over-voltage (voltage) 01 00 00 00 00`: the code, the classes in the error register,
/// the manufacturer's bytes. What is all zeros is left out.
impl fmt::Display for Emergency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h {}", self.code, self.words())?;
        for (place, class) in error_codes::classes(self.register).enumerate() {
            let lead = if place == 0 { " (" } else { ", " };
            write!(f, "{lead}{class}")?;
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
    fn an_error_reset_says_so() {
        let reset = Emergency::decode(&[0; 8]).unwrap();
        assert!(reset.is_reset());
        assert_eq!(reset.to_string(), "0000h error reset");
    }

    #[test]
    fn other_lengths_are_no_emergency() {
        for length in (0..8).chain(9..12) {
            assert_eq!(Emergency::decode(&vec![0; length]), None);
        }
    }
}
