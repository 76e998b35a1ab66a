//! Emergencies (CiA 301, 7.2.7; codes of CiA 402 and its predecessor DS 301 in words).
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
        let known = |code: u16| CODES.iter().find(|(known, _)| *known == code);
        let class =
            [0xFFFF, 0xFFF0, 0xFF00, 0xF000].iter().find_map(|mask| known(self.code & mask));
        class.map_or("unknown error", |(_, words)| *words)
    }
}

/// Every code that has words of its own, with them.
pub fn codes() -> impl Iterator<Item = (u16, &'static str)> {
    CODES.iter().copied()
}

/// `8250h RPDO timeout (register 11h: generic, communication), 00 00 00 00 01`.
impl fmt::Display for Emergency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h {} (register {:02X}h", self.code, self.words(), self.register)?;
        let mut lead = ": ";
        for (bit, class) in REGISTER {
            if self.register & bit != 0 {
                write!(f, "{lead}{class}")?;
                lead = ", ";
            }
        }
        f.write_str(")")?;
        if self.manufacturer != [0; 5] {
            let [a, b, c, d, e] = self.manufacturer;
            write!(f, ", {a:02X} {b:02X} {c:02X} {d:02X} {e:02X}")?;
        }
        Ok(())
    }
}

/// The bits of the error register (CiA 301, 7.5.2.2).
const REGISTER: [(u8, &str); 7] = [
    (0x01, "generic"),
    (0x02, "current"),
    (0x04, "voltage"),
    (0x08, "temperature"),
    (0x10, "communication"),
    (0x20, "profile"),
    (0x80, "manufacturer"),
];

/// Error codes; those ending in zeros stand for their class too.
const CODES: &[(u16, &str)] = &[
    (0x0000, "error reset"),
    (0x1000, "generic error"),
    (0x2000, "current"),
    (0x2100, "current at the input"),
    (0x2110, "short circuit or earth leakage at the input"),
    (0x2120, "earth leakage at the input"),
    (0x2130, "short circuit at the input"),
    (0x2200, "current inside the device"),
    (0x2220, "over-current inside the device"),
    (0x2230, "short circuit or earth leakage inside the device"),
    (0x2240, "earth leakage inside the device"),
    (0x2250, "short circuit inside the device"),
    (0x2300, "current at the output"),
    (0x2310, "over-current at the output"),
    (0x2320, "short circuit or earth leakage at the motor"),
    (0x2330, "earth leakage at the motor"),
    (0x2340, "short circuit at the motor"),
    (0x3000, "voltage"),
    (0x3100, "mains voltage"),
    (0x3110, "mains over-voltage"),
    (0x3120, "mains under-voltage"),
    (0x3130, "mains phase failure"),
    (0x3200, "DC link voltage"),
    (0x3210, "DC link over-voltage"),
    (0x3220, "DC link under-voltage"),
    (0x3230, "DC link load error"),
    (0x3300, "output voltage"),
    (0x3310, "output over-voltage"),
    (0x3320, "armature circuit"),
    (0x3330, "field circuit"),
    (0x4000, "temperature"),
    (0x4100, "ambient temperature"),
    (0x4110, "ambient over-temperature"),
    (0x4120, "ambient under-temperature"),
    (0x4200, "device temperature"),
    (0x4210, "device over-temperature"),
    (0x4220, "device under-temperature"),
    (0x4300, "drive temperature"),
    (0x4310, "drive over-temperature"),
    (0x4320, "drive under-temperature"),
    (0x4400, "supply temperature"),
    (0x4410, "supply over-temperature"),
    (0x4420, "supply under-temperature"),
    (0x5000, "device hardware"),
    (0x5100, "supply"),
    (0x5110, "low-voltage supply"),
    (0x5111, "supply U1, ±15 V"),
    (0x5112, "supply U2, +24 V"),
    (0x5113, "supply U3, +5 V"),
    (0x5120, "intermediate circuit supply"),
    (0x5200, "control hardware"),
    (0x5210, "measurement circuit"),
    (0x5220, "computing circuit"),
    (0x5300, "operating unit"),
    (0x5400, "power section"),
    (0x5410, "output stages"),
    (0x5420, "chopper"),
    (0x5430, "input stages"),
    (0x5440, "contacts"),
    (0x5450, "fuses"),
    (0x5500, "memory"),
    (0x5510, "RAM"),
    (0x5520, "ROM"),
    (0x5530, "EEPROM"),
    (0x6000, "device software"),
    (0x6010, "software reset by watchdog"),
    (0x6100, "internal software"),
    (0x6200, "user software"),
    (0x6300, "data record"),
    (0x6310, "loss of parameters"),
    (0x6320, "parameter error"),
    (0x7000, "additional modules"),
    (0x7100, "power module"),
    (0x7110, "brake chopper"),
    (0x7120, "motor"),
    (0x7121, "motor blocked"),
    (0x7122, "motor error or commutation malfunction"),
    (0x7123, "motor tilted"),
    (0x7200, "measurement module"),
    (0x7300, "sensor"),
    (0x7301, "tacho fault"),
    (0x7302, "tacho wrong polarity"),
    (0x7303, "resolver 1 fault"),
    (0x7304, "resolver 2 fault"),
    (0x7305, "encoder 1 fault"),
    (0x7306, "encoder 2 fault"),
    (0x7307, "encoder 3 fault"),
    (0x7310, "speed sensing"),
    (0x7320, "position sensing"),
    (0x7400, "computation module"),
    (0x7500, "communication module"),
    (0x7600, "external data storage"),
    (0x8000, "monitoring"),
    (0x8100, "communication"),
    (0x8110, "CAN overrun"),
    (0x8120, "CAN in error passive mode"),
    (0x8130, "heartbeat or life guard error"),
    (0x8140, "recovered from bus-off"),
    (0x8150, "COB-ID collision"),
    (0x8200, "protocol error"),
    (0x8210, "PDO not processed: too short"),
    (0x8220, "PDO too long"),
    (0x8230, "DAM MPDO not processed"),
    (0x8240, "SYNC of unexpected length"),
    (0x8250, "RPDO timeout"),
    (0x8300, "torque control"),
    (0x8311, "excess torque"),
    (0x8312, "difficult start-up"),
    (0x8313, "standstill torque"),
    (0x8321, "insufficient torque"),
    (0x8331, "torque fault"),
    (0x8400, "speed control"),
    (0x8500, "position control"),
    (0x8600, "positioning"),
    (0x8611, "following error"),
    (0x8612, "reference limit"),
    (0x8700, "synchronisation control"),
    (0x8800, "winding control"),
    (0x8900, "process data monitoring"),
    (0x9000, "external error"),
    (0xF000, "additional functions"),
    (0xF001, "deceleration"),
    (0xF002, "sub-synchronous run"),
    (0xF003, "stroke operation"),
    (0xF004, "control function"),
    (0xFF00, "error of the manufacturer's own"),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn emergency(code: u16) -> Emergency {
        Emergency { code, register: 0, manufacturer: [0; 5] }
    }

    #[test]
    fn eight_bytes_read_as_a_sentence() {
        let emergency = Emergency::decode(&[0x50, 0x82, 0x11, 0, 0, 0, 0, 1]).unwrap();
        let sentence = "8250h RPDO timeout (register 11h: generic, communication), 00 00 00 00 01";
        assert_eq!(emergency.to_string(), sentence);
    }

    #[test]
    fn an_error_reset_says_so() {
        let reset = Emergency::decode(&[0; 8]).unwrap();
        assert!(reset.is_reset());
        assert_eq!(reset.to_string(), "0000h error reset (register 00h)");
    }

    #[test]
    fn a_code_unknown_itself_is_named_by_its_class() {
        assert_eq!(emergency(0x2314).words(), "over-current at the output");
        assert_eq!(emergency(0x23F1).words(), "current at the output");
        assert_eq!(emergency(0x2F00).words(), "current");
        assert_eq!(emergency(0xFF42).words(), "error of the manufacturer's own");
        assert_eq!(emergency(0xA000).words(), "unknown error");
        assert_eq!(emergency(0x0001).words(), "error reset");
    }

    #[test]
    fn other_lengths_are_no_emergency() {
        for length in (0..8).chain(9..12) {
            assert_eq!(Emergency::decode(&vec![0; length]), None);
        }
    }

    #[test]
    fn the_table_is_in_order_and_says_nothing_twice() {
        assert!(CODES.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
