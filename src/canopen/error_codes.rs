//! Error codes of emergencies (CiA 301, 7.2.7.1; for drives CiA 402) and bits of the error register (1001h),
//! with their text.
//!
//! The same codes appear in 603Fh and in the error history (1003h).

/// Continuous over-current of the motor.
pub const OVER_CURRENT: u16 = 0x2310;
/// Over-voltage of the DC link.
pub const OVER_VOLTAGE: u16 = 0x3210;
/// Under-voltage of the DC link.
pub const UNDER_VOLTAGE: u16 = 0x3220;
/// Over-temperature of the drive.
pub const OVER_TEMPERATURE: u16 = 0x4310;
/// Motor speed above its maximum (6080h).
pub const OVER_SPEED: u16 = 0x7310;
/// Life guard or heartbeat error: the monitored node is lost.
pub const MASTER_LOST: u16 = 0x8130;
/// Recovered from bus-off: the node has returned to a bus that its error counter had taken it off.
pub const RECOVERED_FROM_BUS_OFF: u16 = 0x8140;
/// RPDO event timer expired.
pub const RPDO_TIMEOUT: u16 = 0x8250;
/// Following error: the position has left its window around the demanded one (6065h, CiA 402-2).
pub const FOLLOWING_ERROR: u16 = 0x8611;
/// Safe torque off requested. CiA 402 defines only its class, control monitoring; this is maxon's code.
pub const SAFE_TORQUE_OFF: u16 = 0x8A88;

/// One code of every class of CiA 301 and 402, for tests.
pub const OF_DRIVES: [u16; 12] = [
    0x1000, 0x2310, 0x2320, 0x3110, 0x3210, 0x4210, 0x4310, 0x5113, 0x6100, 0x7305, 0x8110, 0x8611,
];

/// Returns whether the code is device-specific (FFxxh): the standard gives it no meaning.
pub const fn is_device_specific(code: u16) -> bool {
    code & 0xFF00 == 0xFF00
}

/// Returns whether the code reports a communication or protocol error (81xxh, 82xxh).
pub const fn is_of_communication(code: u16) -> bool {
    matches!(code & 0xFF00, 0x8100 | 0x8200)
}

/// Text of an error code, or of its class if the code is unknown.
pub fn description(code: u16) -> &'static str {
    let known = |code: u16| CODES.iter().find(|(known, _)| *known == code);
    let class = [0xFFFF, 0xFFF0, 0xFF00, 0xF000].iter().find_map(|mask| known(code & mask));
    class.map_or("unknown error", |(_, text)| *text)
}

/// All codes with a specific text.
pub fn all() -> impl Iterator<Item = (u16, &'static str)> {
    CODES.iter().copied()
}

/// Error classes in an error register, in the order of its bits.
pub fn classes(register: u8) -> impl Iterator<Item = &'static str> {
    REGISTER.into_iter().filter(move |(bit, _)| register & bit != 0).map(|(_, class)| class)
}

/// Bits of the error register (CiA 301, 7.5.2.2), the reserved one included.
const REGISTER: [(u8, &str); 8] = [
    (0x01, "generic"),
    (0x02, "current"),
    (0x04, "voltage"),
    (0x08, "temperature"),
    (0x10, "communication"),
    (0x20, "device profile"),
    (0x40, "reserved bit"),
    (0x80, "manufacturer"),
];

/// Error codes in ascending order. Codes that end in zeros are also those of their class.
const CODES: &[(u16, &str)] = &[
    (0x0000, "error reset"),
    (0x1000, "generic error"),
    (0x2000, "current"),
    (0x2100, "current at the input"),
    (0x2110, "short circuit or earth leakage at the input"),
    (0x2120, "earth leakage at the input"),
    (0x2121, "earth leakage of phase L1"),
    (0x2122, "earth leakage of phase L2"),
    (0x2123, "earth leakage of phase L3"),
    (0x2130, "short circuit at the input"),
    (0x2131, "short circuit of phases L1 and L2"),
    (0x2132, "short circuit of phases L2 and L3"),
    (0x2133, "short circuit of phases L3 and L1"),
    (0x2200, "current inside the device"),
    (0x2211, "internal current 1"),
    (0x2212, "internal current 2"),
    (0x2213, "over-current in a ramp"),
    (0x2214, "over-current in a sequence"),
    (0x2220, "continuous over-current inside the device"),
    (0x2221, "continuous over-current 1 inside the device"),
    (0x2222, "continuous over-current 2 inside the device"),
    (0x2230, "short circuit or earth leakage inside the device"),
    (0x2240, "earth leakage inside the device"),
    (0x2250, "short circuit inside the device"),
    (0x2300, "current at the output"),
    (0x2310, "continuous over-current at the output"),
    (0x2311, "continuous over-current 1 at the output"),
    (0x2312, "continuous over-current 2 at the output"),
    (0x2320, "short circuit or earth leakage at the motor"),
    (0x2330, "earth leakage at the motor"),
    (0x2331, "earth leakage of phase U"),
    (0x2332, "earth leakage of phase V"),
    (0x2333, "earth leakage of phase W"),
    (0x2340, "short circuit at the motor"),
    (0x2341, "short circuit of phases U and V"),
    (0x2342, "short circuit of phases V and W"),
    (0x2343, "short circuit of phases W and U"),
    (0x2350, "overload: I²t or thermal model"),
    (0x2351, "overload warning: I²t or thermal model"),
    (0x3000, "voltage"),
    (0x3100, "mains voltage"),
    (0x3110, "mains over-voltage"),
    (0x3111, "mains over-voltage of phase L1"),
    (0x3112, "mains over-voltage of phase L2"),
    (0x3113, "mains over-voltage of phase L3"),
    (0x3120, "mains under-voltage"),
    (0x3121, "mains under-voltage of phase L1"),
    (0x3122, "mains under-voltage of phase L2"),
    (0x3123, "mains under-voltage of phase L3"),
    (0x3130, "mains phase failure"),
    (0x3131, "failure of phase L1"),
    (0x3132, "failure of phase L2"),
    (0x3133, "failure of phase L3"),
    (0x3134, "phase sequence"),
    (0x3140, "mains frequency"),
    (0x3141, "mains frequency too high"),
    (0x3142, "mains frequency too low"),
    (0x3200, "DC link voltage"),
    (0x3210, "DC link over-voltage"),
    (0x3211, "DC link over-voltage 1"),
    (0x3212, "DC link over-voltage 2"),
    (0x3220, "DC link under-voltage"),
    (0x3221, "DC link under-voltage 1"),
    (0x3222, "DC link under-voltage 2"),
    (0x3230, "DC link load error"),
    (0x3300, "output voltage"),
    (0x3310, "output over-voltage"),
    (0x3311, "output over-voltage of phase U"),
    (0x3312, "output over-voltage of phase V"),
    (0x3313, "output over-voltage of phase W"),
    (0x3320, "armature circuit"),
    (0x3321, "armature circuit interrupted"),
    (0x3330, "field circuit"),
    (0x3331, "field circuit interrupted"),
    (0x4000, "temperature"),
    (0x4100, "ambient temperature"),
    (0x4110, "ambient temperature too high"),
    (0x4120, "ambient temperature too low"),
    (0x4130, "temperature of the supply air"),
    (0x4140, "temperature of the outlet air"),
    (0x4200, "device temperature"),
    (0x4210, "device temperature too high"),
    (0x4220, "device temperature too low"),
    (0x4300, "drive temperature"),
    (0x4310, "drive temperature too high"),
    (0x4320, "drive temperature too low"),
    (0x4400, "supply temperature"),
    (0x4410, "supply temperature too high"),
    (0x4420, "supply temperature too low"),
    (0x5000, "device hardware"),
    (0x5100, "supply"),
    (0x5110, "low-voltage supply"),
    (0x5111, "supply U1, ±15 V"),
    (0x5112, "supply U2, +24 V"),
    (0x5113, "supply U3, +5 V"),
    (0x5114, "supply U4"),
    (0x5115, "supply U5"),
    (0x5116, "supply U6"),
    (0x5117, "supply U7"),
    (0x5118, "supply U8"),
    (0x5119, "supply U9"),
    (0x5120, "supply of the DC link"),
    (0x5200, "control hardware"),
    (0x5210, "measurement circuit"),
    (0x5220, "computing circuit"),
    (0x5300, "operating unit"),
    (0x5400, "power section"),
    (0x5410, "output stages"),
    (0x5420, "chopper"),
    (0x5430, "input stages"),
    (0x5440, "contacts"),
    (0x5441, "contact 1"),
    (0x5442, "contact 2"),
    (0x5443, "contact 3"),
    (0x5444, "contact 4"),
    (0x5445, "contact 5"),
    (0x5450, "fuses"),
    (0x5451, "fuse S1"),
    (0x5452, "fuse S2"),
    (0x5453, "fuse S3"),
    (0x5454, "fuse S4"),
    (0x5455, "fuse S5"),
    (0x5456, "fuse S6"),
    (0x5457, "fuse S7"),
    (0x5458, "fuse S8"),
    (0x5459, "fuse S9"),
    (0x5500, "memory"),
    (0x5510, "RAM"),
    (0x5520, "program memory"),
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
    (0x7111, "brake chopper failed"),
    (0x7112, "over-current in the brake chopper"),
    (0x7113, "protective circuit of the brake chopper"),
    (0x7120, "motor"),
    (0x7121, "motor blocked"),
    (0x7122, "motor error or commutation malfunction"),
    (0x7123, "motor tilted"),
    (0x7200, "measurement module"),
    (0x7300, "sensor"),
    (0x7301, "tacho fault"),
    (0x7302, "tacho with wrong polarity"),
    (0x7303, "resolver 1 fault"),
    (0x7304, "resolver 2 fault"),
    (0x7305, "incremental sensor 1 fault"),
    (0x7306, "incremental sensor 2 fault"),
    (0x7307, "incremental sensor 3 fault"),
    (0x7310, "speed"),
    (0x7320, "position"),
    (0x7400, "computation module"),
    (0x7500, "communication module"),
    (0x7510, "serial interface 1"),
    (0x7520, "serial interface 2"),
    (0x7600, "external data storage"),
    (0x8000, "monitoring"),
    (0x8100, "communication"),
    (0x8110, "CAN overrun: messages lost"),
    (0x8120, "CAN in error passive mode"),
    (0x8130, "life guard or heartbeat error"),
    (0x8140, "recovered from bus-off"),
    (0x8150, "CAN-ID collision"),
    (0x8200, "protocol error"),
    (0x8210, "PDO not processed: wrong length"),
    (0x8220, "PDO longer than its mapping"),
    (0x8230, "DAM MPDO not processed"),
    (0x8240, "SYNC of unexpected length"),
    (0x8250, "RPDO timeout"),
    (0x8300, "torque control"),
    (0x8311, "excess torque"),
    (0x8312, "difficult start-up"),
    (0x8313, "standstill torque"),
    (0x8321, "insufficient torque"),
    (0x8331, "torque fault"),
    (0x8400, "velocity controller"),
    (0x8500, "position controller"),
    (0x8600, "positioning controller"),
    (FOLLOWING_ERROR, "following error"),
    (0x8612, "reference limit"),
    (0x8700, "synchronisation controller"),
    (0x8800, "winding controller"),
    (0x8900, "process data monitoring"),
    (0x8A00, "control monitoring"),
    (SAFE_TORQUE_OFF, "safe torque off"),
    (0x9000, "external error"),
    (0xF000, "additional functions"),
    (0xF001, "deceleration"),
    (0xF002, "sub-synchronous run"),
    (0xF003, "stroke operation"),
    (0xF004, "control"),
    (0xFF00, "manufacturer-specific error"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_code_reads_as_its_class() {
        for (code, text) in [
            (0x3210, "DC link over-voltage"),
            (0x5114, "supply U4"),
            (0x7305, "incremental sensor 1 fault"),
            (0x2314, "continuous over-current at the output"),
            (0x23F1, "current at the output"),
            (0x2F00, "current"),
            (0xFF42, "manufacturer-specific error"),
            (0xA000, "unknown error"),
            (0x0001, "error reset"),
        ] {
            assert_eq!(description(code), text, "{code:04X}h");
        }
    }

    #[test]
    fn every_register_bit_has_a_text() {
        assert_eq!(classes(0).count(), 0);
        assert_eq!(classes(0xFF).count(), 8);
        assert_eq!(classes(0x11).collect::<Vec<_>>(), ["generic", "communication"]);
    }

    #[test]
    fn table_is_sorted_without_duplicates() {
        assert!(CODES.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn every_class_of_the_standard_is_present() {
        for class in (0x10..=0x90).step_by(0x10).chain([0xF0, 0xFF]) {
            assert!(CODES.iter().any(|(code, _)| *code == class << 8), "{class:02X}xxh");
        }
    }
}
