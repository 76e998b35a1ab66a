//! Text of error frames of a CAN controller in Linux (`linux/can/error.h`).
//!
//! Their identifier is a bit mask: 20000080h is a bus error, not a SYNC.

use std::fmt;

/// Error frame of Linux; `Display` names its classes and their details.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorFrame {
    /// Error classes, one bit each.
    pub classes: u32,
    /// Data, padded with zeros.
    pub data: [u8; 8],
}

const ARBITRATION: u32 = 0x02;
const CONTROLLER: u32 = 0x04;
const PROTOCOL: u32 = 0x08;
const COUNTERS: u32 = 0x200;

const CLASSES: [(u32, &str); 9] = [
    (0x01, "transmit timeout"),
    (ARBITRATION, "arbitration lost"),
    (CONTROLLER, "controller"),
    (PROTOCOL, "protocol violation"),
    (0x10, "transceiver"),
    (0x20, "no acknowledgement"),
    (0x40, "bus off"),
    (0x80, "bus error"),
    (0x100, "controller restarted"),
];

/// Controller status, byte 1.
const OF_CONTROLLER: [(u8, &str); 7] = [
    (0x01, "receive overflow"),
    (0x02, "transmit overflow"),
    (0x04, "receive warning"),
    (0x08, "transmit warning"),
    (0x10, "receive passive"),
    (0x20, "transmit passive"),
    (0x40, "active again"),
];

/// Protocol error, byte 2.
const OF_PROTOCOL: [(u8, &str); 8] = [
    (0x01, "single bit"),
    (0x02, "form"),
    (0x04, "bit stuffing"),
    (0x08, "dominant bit not sent"),
    (0x10, "recessive bit not sent"),
    (0x20, "bus overload"),
    (0x40, "error active announced"),
    (0x80, "while sending"),
];

/// `bus off, controller (transmit passive), counters 128 sent 0 received`
impl fmt::Display for ErrorFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [bit, controller, protocol, _, _, _, sent, received] = self.data;
        let mut separator = "";
        for (class, text) in CLASSES {
            if self.classes & class == 0 {
                continue;
            }
            write!(f, "{separator}{text}")?;
            separator = ", ";
            match class {
                ARBITRATION if bit != 0 => write!(f, " in bit {bit}")?,
                CONTROLLER => details(controller, &OF_CONTROLLER, f)?,
                PROTOCOL => details(protocol, &OF_PROTOCOL, f)?,
                _ => {}
            }
        }
        if self.classes & COUNTERS != 0 || (sent, received) != (0, 0) {
            write!(f, "{separator}counters {sent} sending, {received} receiving")?;
            separator = ", ";
        }
        if separator.is_empty() { f.write_str("no error class") } else { Ok(()) }
    }
}

fn details(bits: u8, of: &[(u8, &str)], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let mut separator = " (";
    for (_, text) in of.iter().filter(|(bit, _)| bits & bit != 0) {
        write!(f, "{separator}{text}")?;
        separator = ", ";
    }
    f.write_str(if separator == " (" { "" } else { ")" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_read_by_class_and_detail() {
        let text = |classes, data| ErrorFrame { classes, data }.to_string();
        assert_eq!(text(0x80, [0; 8]), "bus error");
        assert_eq!(
            text(0x44, [0, 0x28, 0, 0, 0, 0, 128, 3]),
            "controller (transmit warning, transmit passive), bus off, \
             counters 128 sending, 3 receiving"
        );
        assert_eq!(
            text(0x08, [0, 0, 0x84, 0, 0, 0, 0, 0]),
            "protocol violation (bit stuffing, while sending)"
        );
        assert_eq!(text(0, [0; 8]), "no error class");
    }
}
