//! Text of LSS and TIME (CiA 305; CiA 301, 7.2.6).

use std::fmt;

use canopen_rs::lss::UNCONFIGURED_NODE_ID;
use canopen_rs::time::TimeOfDay;

/// LSS message of eight bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lss {
    /// Set for a request of the master.
    pub is_request: bool,
    /// Command specifier (CiA 305), then its parameters.
    pub data: [u8; 8],
}

/// `→ node-id 3`, `← node-id taken`
impl fmt::Display for Lss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_request { "→ " } else { "← " })?;
        let [command, first, second, ..] = self.data;
        let [_, a, b, c, d, bit, sub, next] = self.data;
        let number = u32::from_le_bytes([a, b, c, d]);
        match (command, self.is_request) {
            (0x04, true) => f.write_str(match first {
                0 => "all to waiting",
                1 => "all to configuration",
                _ => "all to an unknown state",
            }),
            (0x11, true) if first == UNCONFIGURED_NODE_ID => f.write_str("no node-id"),
            (0x11, true) => write!(f, "node-id {first}"),
            (0x13, true) => write!(f, "bit timing {second} of table {first}"),
            (0x15, true) => write!(f, "activate bit timing in {} ms", u16::from_le_bytes([a, b])),
            (0x17, true) => f.write_str("store"),
            (0x11, false) => outcome("node-id", first, second, f),
            (0x13, false) => outcome("bit timing", first, second, f),
            (0x17, false) => outcome("store", first, second, f),
            (0x40..=0x43, true) => write!(f, "select {} {number:08X}h", part(command)),
            (0x44, false) => f.write_str("selected"),
            (0x46..=0x4B, true) => write!(f, "identify {} {number:08X}h", range(command)),
            (0x4C, true) => f.write_str("identify the unconfigured"),
            (0x4F, false) => f.write_str("here"),
            (0x50, false) => f.write_str("here, unconfigured"),
            (0x51, true) if bit == 0x80 => f.write_str("fastscan: who is unconfigured?"),
            (0x51, true) => {
                let part = part(0x40 + (sub & 3));
                write!(f, "fastscan {part} {number:08X}h from bit {bit}, next {next}")
            }
            (0x5A..=0x5D, true) => write!(f, "which {}?", part(command - 0x1A)),
            (0x5A..=0x5D, false) => write!(f, "{} {number:08X}h", part(command - 0x1A)),
            (0x5E, true) => f.write_str("which node-id?"),
            (0x5E, false) if first == UNCONFIGURED_NODE_ID => f.write_str("no node-id"),
            (0x5E, false) => write!(f, "node-id {first}"),
            _ => write!(f, "unknown service {command:02X}h"),
        }
    }
}

/// Name of a part of the LSS address.
const fn part(command: u8) -> &'static str {
    match command & 3 {
        0 => "vendor-ID",
        1 => "product code",
        2 => "revision",
        _ => "serial number",
    }
}

/// Name of an identification criterion.
const fn range(command: u8) -> &'static str {
    match command {
        0x46 => "vendor-ID",
        0x47 => "product code",
        0x48 => "revision from",
        0x49 => "revision to",
        0x4A => "serial number from",
        _ => "serial number to",
    }
}

fn outcome(what: &str, error: u8, specific: u8, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match error {
        0 => write!(f, "{what} taken"),
        0xFF => write!(f, "{what} refused: manufacturer-specific error {specific:02X}h"),
        _ => write!(f, "{what} refused: error {error:02X}h"),
    }
}

/// Time as text: `2026-01-31 08:15:00.250`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock(pub TimeOfDay);

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let TimeOfDay { milliseconds, days } = self.0;
        // Counted from 1 March 1980: leap days then end a year.
        let mut days = u32::from(days) + 1_401;
        let cycles = days / 1_461;
        days %= 1_461;
        let years = (days / 365).min(3);
        let day_of_year = days - years * 365;
        let shifted = (5 * day_of_year + 2) / 153;
        let day = day_of_year - (153 * shifted + 2) / 5 + 1;
        let (month, carry) = if shifted < 10 { (shifted + 3, 0) } else { (shifted - 9, 1) };
        let year = 1_980 + 4 * cycles + years + carry;
        let (seconds, millis) = (milliseconds / 1_000, milliseconds % 1_000);
        let (hours, minutes) = (seconds / 3_600, seconds / 60 % 60);
        write!(f, "{year}-{month:02}-{day:02} ")?;
        write!(f, "{hours:02}:{minutes:02}:{:02}.{millis:03}", seconds % 60)
    }
}

#[cfg(test)]
mod tests {
    use canopen_rs::lss::{
        LssAddress, encode_configure_node_id, encode_fastscan, encode_inquire_node_id,
        encode_store, encode_switch_global, encode_switch_selective,
    };
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn encoded_requests_have_their_text() {
        let address =
            LssAddress { vendor_id: 1, product_code: 2, revision_number: 3, serial_number: 4 };
        let mut requests = vec![encode_switch_global(true), encode_configure_node_id(3)];
        requests.extend(encode_switch_selective(&address));
        requests.extend([encode_store(), encode_inquire_node_id(), encode_fastscan(5, 31, 0, 0)]);
        let read: Vec<_> =
            requests.into_iter().map(|data| Lss { is_request: true, data }.to_string()).collect();
        assert_eq!(
            read,
            [
                "→ all to configuration",
                "→ node-id 3",
                "→ select vendor-ID 00000001h",
                "→ select product code 00000002h",
                "→ select revision 00000003h",
                "→ select serial number 00000004h",
                "→ store",
                "→ which node-id?",
                "→ fastscan vendor-ID 00000005h from bit 31, next 0",
            ]
        );
        let refused = Lss { is_request: false, data: [0x11, 1, 0, 0, 0, 0, 0, 0] };
        assert_eq!(refused.to_string(), "← node-id refused: error 01h");
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        let date = |days| Clock(TimeOfDay::new(0, days)).to_string();
        assert_eq!(date(0), "1984-01-01 00:00:00.000");
        assert_eq!(date(59), "1984-02-29 00:00:00.000");
        assert_eq!(date(60), "1984-03-01 00:00:00.000");
        assert_eq!(date(366), "1985-01-01 00:00:00.000");
        assert_eq!(date(5_844), "2000-01-01 00:00:00.000");
        assert_eq!(date(15_371), "2026-01-31 00:00:00.000");
    }

    proptest! {
        #[test]
        fn any_message_has_a_text(is_request: bool, data: [u8; 8], days: u16, millis: u32) {
            let lss = Lss { is_request, data };
            prop_assert!(!lss.to_string().is_empty());
            prop_assert!(!Clock(TimeOfDay::new(millis, days)).to_string().is_empty());
        }
    }
}
