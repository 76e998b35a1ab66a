//! Names of objects and text of their values, from CiA 301, 401 and 402.
//!
//! Covers the common objects. Names of device-specific ones come from an [EDS](canopen::eds).

use std::fmt;

use canopen::drive::{Controlword, State, Statusword};
use canopen::object::Object;
use canopen::sync::TransmissionType;
use config::switch_inputs::{Contacts, SwitchInputs};

// Data types by their numbers in CiA 301, 7.4.7.1.
const I8: u16 = 0x02;
const I16: u16 = 0x03;
const I32: u16 = 0x04;
const U8: u16 = 0x05;
const U16: u16 = 0x06;
const U32: u16 = 0x07;
const TEXT: u16 = 0x09;

/// Objects with their name, unit after a comma, and data type.
const OBJECTS: &[(Object, &str, u16)] = &[
    (Object::DEVICE_TYPE, "device type", U32),
    (Object::ERROR_REGISTER, "error register", U8),
    (at(0x1002, 0), "manufacturer status", U32),
    (Object::ERROR_HISTORY, "number of errors", U8),
    (Object::SYNC_COB_ID, "SYNC COB-ID", U32),
    (at(0x1006, 0), "communication cycle, µs", U32),
    (at(0x1007, 0), "synchronous window, µs", U32),
    (Object::DEVICE_NAME, "device name", TEXT),
    (Object::HARDWARE_VERSION, "hardware version", TEXT),
    (Object::SOFTWARE_VERSION, "software version", TEXT),
    (at(0x1010, 0), "ways to store", U8),
    (at(0x1010, 1), "store all", U32),
    (at(0x1011, 0), "ways to restore", U8),
    (at(0x1011, 1), "restore all", U32),
    (at(0x1012, 0), "TIME COB-ID", U32),
    (Object::EMCY_COB_ID, "EMCY COB-ID", U32),
    (at(0x1015, 0), "EMCY inhibit time, × 100 µs", U16),
    (Object::CONSUMER_HEARTBEAT, "consumer heartbeat", U32),
    (Object::PRODUCER_HEARTBEAT, "producer heartbeat, ms", U16),
    (Object::VENDOR_ID, "vendor-ID", U32),
    (Object::PRODUCT_CODE, "product code", U32),
    (Object::REVISION, "revision", U32),
    (Object::SERIAL, "serial number", U32),
    (at(0x1019, 0), "SYNC counter overflow", U8),
    (Object::ERROR_BEHAVIOUR, "behaviour on communication error", U8),
    (at(0x1F80, 0), "NMT start-up", U32),
    (Object::DIGITAL_INPUTS, "digital inputs", U8),
    (at(0x6401, 1), "analogue input 1", I16),
    (at(0x6401, 2), "analogue input 2", I16),
    (at(0x6401, 3), "analogue input 3", I16),
    (at(0x6401, 4), "analogue input 4", I16),
    (Object::ABORT_CONNECTION, "abort connection option", I16),
    (Object::ERROR_CODE, "error code", U16),
    (Object::CONTROLWORD, "controlword", U16),
    (Object::STATUSWORD, "statusword", U16),
    (Object::QUICK_STOP_OPTION, "quick stop option", I16),
    (Object::SHUTDOWN_OPTION, "shutdown option", I16),
    (Object::DISABLE_OPERATION_OPTION, "disable operation option", I16),
    (Object::HALT_OPTION, "halt option", I16),
    (Object::FAULT_REACTION, "fault reaction option", I16),
    (Object::MODE_OF_OPERATION, "mode", I8),
    (Object::MODE_DISPLAY, "mode display", I8),
    (at(0x6062, 0), "position demand", I32),
    (Object::POSITION_ACTUAL, "position", I32),
    (at(0x606B, 0), "velocity demand", I32),
    (Object::VELOCITY_ACTUAL, "velocity", I32),
    (Object::TARGET_TORQUE, "target torque", I16),
    (Object::MAX_TORQUE, "maximum torque", U16),
    (Object::TORQUE_DEMAND, "torque demand", I16),
    (at(0x6075, 0), "rated current, mA", U32),
    (Object::RATED_TORQUE, "rated torque, mN·m", U32),
    (Object::TORQUE_ACTUAL, "torque", I16),
    (at(0x6078, 0), "current", I16),
    (at(0x6079, 0), "DC link voltage, mV", U32),
    (at(0x607A, 0), "target position", I32),
    (Object::MAX_MOTOR_SPEED, "maximum motor speed", U32),
    (at(0x6087, 0), "torque slope", U32),
    (at(0x60B2, 0), "torque offset", I16),
    (at(0x60C2, 1), "interpolation time", U8),
    (at(0x60C2, 2), "interpolation time exponent", I8),
    (at(0x60FD, 0), "digital inputs", U32),
    (at(0x60FF, 0), "target velocity", I32),
    (Object::SUPPORTED_MODES, "supported modes", U32),
];

const fn at(index: u16, sub: u8) -> Object {
    Object { index, sub }
}

/// PDO of a PDO parameter: its kind, whether it is a mapping parameter, and its number.
fn pdo_parameter(index: u16) -> Option<(&'static str, bool, u16)> {
    let (kind, is_mapping, first) = match index {
        0x1400..=0x15FF => ("RPDO", false, 0x1400),
        0x1600..=0x17FF => ("RPDO", true, 0x1600),
        0x1800..=0x19FF => ("TPDO", false, 0x1800),
        0x1A00..=0x1BFF => ("TPDO", true, 0x1A00),
        _ => return None,
    };
    Some((kind, is_mapping, index - first + 1))
}

/// Returns the name of an object without its unit; `None` for PDO parameters and unknown objects.
pub fn name(object: Object) -> Option<&'static str> {
    let (_, name, _) = OBJECTS.iter().find(|(known, ..)| *known == object)?;
    Some(name.split_once(", ").map_or(*name, |(name, _)| name))
}

/// Returns the unit of an object's raw value; `None` if it has none or is unknown.
fn unit(object: Object) -> Option<&'static str> {
    if let Some((_, name, _)) = OBJECTS.iter().find(|(known, ..)| *known == object) {
        return name.split_once(", ").map(|(_, unit)| unit);
    }
    match (pdo_parameter(object.index)?, object.sub) {
        ((_, false, _), 3) => Some("× 100 µs"),
        ((_, false, _), 5) => Some("ms"),
        _ => None,
    }
}

/// Returns the data type of an object, by number.
pub fn data_type(object: Object) -> Option<u16> {
    if let Some((.., of)) = OBJECTS.iter().find(|(known, ..)| *known == object) {
        return Some(*of);
    }
    match (pdo_parameter(object.index)?, object.sub) {
        ((_, true, _), 1..) | ((_, false, _), 1) => Some(U32),
        ((_, false, _), 3 | 5) => Some(U16),
        _ => Some(U8),
    }
}

/// Returns whether a data type is a signed integer.
pub const fn is_signed(data_type: u16) -> bool {
    matches!(data_type, I8 | I16 | I32 | 0x10 | 0x12..=0x15)
}

/// Text of an object: `6071h target torque`, `1600h:2 RPDO1 mapping 2`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectText<'n> {
    pub object: Object,
    /// Name by the manufacturer, for objects without a standard name.
    pub fallback: Option<&'n str>,
}

impl fmt::Display for ObjectText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let object = self.object;
        write!(f, "{object}")?;
        if let Some((kind, is_mapping, number)) = pdo_parameter(object.index) {
            return match (is_mapping, object.sub) {
                (true, 0) => write!(f, " {kind}{number} number mapped"),
                (true, sub) => write!(f, " {kind}{number} mapping {sub}"),
                (false, 0) => write!(f, " {kind}{number} parameters"),
                (false, 1) => write!(f, " {kind}{number} COB-ID"),
                (false, 2) => write!(f, " {kind}{number} transmission"),
                (false, 3) => write!(f, " {kind}{number} inhibit time"),
                (false, 5) => write!(f, " {kind}{number} event timer"),
                (false, sub) => write!(f, " {kind}{number} parameter {sub}"),
            };
        }
        match name(object).or(self.fallback) {
            Some(name) => write!(f, " {name}"),
            None => Ok(()),
        }
    }
}

/// Text of an object's value: `operation enabled`, `-2`, `"frhc drive"`, `6071h target torque, 16 bits`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValueText<'b> {
    /// Object that holds the value; selects the text of enumerations and bit fields.
    pub object: Object,
    /// Bytes of the value, as in SDO; the first ones of a long value.
    pub bytes: &'b [u8],
    /// Total number of bytes.
    pub length: usize,
    /// Data type by the manufacturer, for objects without a standard one.
    pub fallback_type: Option<u16>,
}

/// Maximum displayed bytes of a long value.
const MAX_DISPLAYED: usize = 16;

impl fmt::Display for ValueText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let data_type = data_type(self.object).or(self.fallback_type);
        if data_type == Some(TEXT) {
            return self.text(f);
        }
        let Some(raw) = little_endian(self.bytes).filter(|_| self.length == self.bytes.len())
        else {
            return self.hex(f);
        };
        let [b0, b1, b2, b3, ..] = raw.to_le_bytes();
        let low = u32::from_le_bytes([b0, b1, b2, b3]);
        let word = u16::from_le_bytes([b0, b1]);
        match self.object {
            Object::CONTROLWORD => write!(f, "{word:04X}h {}", Command(Controlword(word))),
            Object::STATUSWORD => write!(f, "{word:04X}h {}", Status(Statusword(word))),
            Object::MODE_OF_OPERATION | Object::MODE_DISPLAY => {
                let mode = i8::from_le_bytes([b0]);
                write!(f, "{mode} {}", mode_of_operation(mode))
            }
            Object::DEVICE_TYPE => write!(f, "{low:08X}h CiA {word}"),
            Object::CONSUMER_HEARTBEAT => write!(f, "node {b2}, {word} ms"),
            Object::EMCY_COB_ID | Object::SYNC_COB_ID => cob_id(low, f),
            Object::VENDOR_ID | Object::PRODUCT_CODE | Object::REVISION => write!(f, "{low:08X}h"),
            Object { index: 0x1010 | 0x1011, sub: 1.. } => self.text(f),
            Object { index, sub } => match (pdo_parameter(index), sub) {
                (Some((_, false, _)), 1) => cob_id(low, f),
                (Some((_, false, _)), 2) => write!(f, "{b0} {}", TransmissionType(b0)),
                (Some((_, true, _)), 1..) => mapped(low, f),
                _ => self.number(raw, data_type, f),
            },
        }
    }
}

impl ValueText<'_> {
    fn text(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"")?;
        for byte in self.bytes {
            for shown in std::ascii::escape_default(*byte) {
                write!(f, "{}", char::from(shown))?;
            }
        }
        f.write_str(if self.length > self.bytes.len() { "…\"" } else { "\"" })
    }

    fn hex(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.length == 0 {
            return f.write_str("nothing");
        }
        write!(f, "{} bytes", self.length)?;
        self.bytes.iter().take(MAX_DISPLAYED).try_for_each(|byte| write!(f, " {byte:02X}"))?;
        f.write_str(if self.length > MAX_DISPLAYED { " …" } else { "" })
    }

    /// Writes a number: decimal if its type is known, else hexadecimal and decimal.
    fn number(&self, raw: u64, of: Option<u16>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match of {
            Some(of) if is_signed(of) => write!(f, "{}", sign_extended(raw, self.length * 8)),
            Some(_) => write!(f, "{raw}"),
            None => write!(f, "{raw:0width$X}h ({raw})", width = self.length * 2),
        }?;
        unit(self.object).map_or(Ok(()), |unit| write!(f, " {unit}"))
    }
}

/// Decodes up to eight bytes.
fn little_endian(bytes: &[u8]) -> Option<u64> {
    let mut eight = [0; 8];
    eight.get_mut(..bytes.len())?.copy_from_slice(bytes);
    (!bytes.is_empty()).then(|| u64::from_le_bytes(eight))
}

/// Extends the sign of the lowest `bits` of `raw`.
pub fn sign_extended(raw: u64, bits: usize) -> i64 {
    let unused = 64_usize.saturating_sub(bits.clamp(1, 64));
    (raw << unused).cast_signed() >> unused
}

fn cob_id(raw: u32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let off = if raw & 1 << 31 == 0 { "" } else { ", off" };
    if raw & 1 << 29 == 0 {
        write!(f, "{:03X}h{off}", raw & 0x7FF)
    } else {
        write!(f, "{:08X}h, 29 bits{off}", raw & 0x1FFF_FFFF)
    }
}

/// Writes a mapping entry: object and length.
fn mapped(raw: u32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let [bits, sub, low, high] = raw.to_le_bytes();
    let object = Object { index: u16::from_le_bytes([low, high]), sub };
    if object.is_dummy() {
        return write!(f, "{object} dummy, {bits} bits");
    }
    write!(f, "{}, {bits} bits", ObjectText { object, fallback: None })
}

/// Name of a mode of operation (CiA 402-2, 6060h).
pub const fn mode_of_operation(mode: i8) -> &'static str {
    match mode {
        0 => "no mode",
        1 => "profile position",
        2 => "velocity",
        3 => "profile velocity",
        4 => "profile torque",
        6 => "homing",
        7 => "interpolated position",
        8 => "cyclic synchronous position",
        9 => "cyclic synchronous velocity",
        10 => "cyclic synchronous torque",
        11 => "cyclic synchronous torque with commutation angle",
        ..0 => "manufacturer-specific mode",
        _ => "unknown mode",
    }
}

/// Text of a controlword (CiA 402-2, 6040h): `enable operation, halt`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command(pub Controlword);

impl Command {
    /// Command of bits 0 to 3, without bit 7.
    pub const fn description(self) -> &'static str {
        match self.0.0 & 0xF {
            0x0 | 0x1 | 0x4 | 0x5 | 0x8 | 0x9 | 0xC | 0xD => "disable voltage",
            0x2 | 0x3 | 0xA | 0xB => "quick stop",
            0x6 | 0xE => "shutdown",
            0x7 => "switch on",
            _ => "enable operation",
        }
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_reset = self.0.0 & Controlword::FAULT_RESET.0 != 0;
        let text = if is_reset { "fault reset" } else { self.description() };
        let halt = if self.0.0 & HALT == 0 { "" } else { ", halt" };
        f.pad(text)?;
        f.write_str(halt)
    }
}

/// Bit 8 of the controlword.
const HALT: u16 = 1 << 8;

/// Text of a statusword (CiA 402-2, 6041h): `operation enabled, internal limit`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status(pub Statusword);

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.0.state().map_or("unknown state", State::description))?;
        for (bit, text) in
            [(Statusword::WARNING, ", warning"), (Statusword::INTERNAL_LIMIT, ", internal limit")]
        {
            f.write_str(if self.0.has(bit) { text } else { "" })?;
        }
        Ok(())
    }
}

/// Text of the switch box's inputs: `deadman pressed   reflection`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switches(pub u8);

impl Switches {
    /// Decoded inputs.
    pub fn inputs(self) -> SwitchInputs {
        SwitchInputs::from_bits(self.0)
    }

    /// State of the deadman's two channels.
    pub fn deadman(self) -> &'static str {
        match self.inputs().deadman() {
            Contacts::Pressed => "pressed",
            Contacts::Released => "released",
            Contacts::Disagreeing => "disagreeing",
        }
    }
}

impl fmt::Display for Switches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let inputs = self.inputs();
        write!(f, "deadman {:8}", self.deadman())?;
        if inputs.deadman() == Contacts::Disagreeing {
            f.write_str(if inputs.deadman_a { ", A and B set" } else { ", A and B clear" })?;
        }
        f.write_str(if inputs.reference { "  reference" } else { "" })?;
        f.write_str(if inputs.reflection { "  reflection" } else { "" })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn text_of(object: Object, bytes: &[u8]) -> String {
        ValueText { object, bytes, length: bytes.len(), fallback_type: None }.to_string()
    }

    #[test]
    fn values_read_by_their_meaning() {
        let cases: [(Object, &[u8], &str); 16] = [
            (Object::STATUSWORD, &[0x37, 0x12], "1237h operation enabled"),
            (Object::CONTROLWORD, &[0x06, 0x00], "0006h shutdown"),
            (Object::CONTROLWORD, &[0x80, 0x01], "0180h fault reset, halt"),
            (Object::MODE_OF_OPERATION, &[10], "10 cyclic synchronous torque"),
            (Object::DEVICE_TYPE, &[0x92, 0x01, 0x02, 0x00], "00020192h CiA 402"),
            (Object::rpdo_communication(2, 1), &[3, 3, 0, 0x80], "303h, off"),
            (Object::rpdo_communication(1, 2), &[1], "1 every SYNC"),
            (Object::tpdo_mapping(1, 2), &[32, 0, 0x64, 0x60], "6064h position, 32 bits"),
            (Object::rpdo_mapping(1, 2), &[16, 0, 3, 0], "0003h dummy, 16 bits"),
            (Object::CONSUMER_HEARTBEAT, &[22, 0, 127, 0], "node 127, 22 ms"),
            (Object::DEVICE_NAME, b"drive\n", "\"drive\\n\""),
            (Object::TARGET_TORQUE, &[0xFE, 0xFF], "-2"),
            (Object::PRODUCER_HEARTBEAT, &[25, 0], "25 ms"),
            (Object::rpdo_communication(1, 5), &[5, 0], "5 ms"),
            (at(0x2000, 1), &[0xFE, 0xFF], "FFFEh (65534)"),
            (at(0x1F50, 1), &[1; 20], "20 bytes 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 01 …"),
        ];
        for (object, bytes, expected) in cases {
            assert_eq!(text_of(object, bytes), expected, "{object}");
        }
    }

    #[test]
    fn standard_names_come_before_those_of_the_manufacturer() {
        let text = |object, fallback| ObjectText { object, fallback }.to_string();
        assert_eq!(text(Object::TARGET_TORQUE, Some("M")), "6071h target torque");
        assert_eq!(text(Object::tpdo_mapping(2, 1), None), "1A01h:1 TPDO2 mapping 1");
        assert_eq!(text(at(0x2000, 1), Some("gain")), "2000h:1 gain");
        assert_eq!(text(at(0x2000, 1), None), "2000h:1");
    }

    proptest! {
        #[test]
        fn any_bytes_of_any_object_have_a_text(
            index in any::<u16>(),
            sub in any::<u8>(),
            bytes in proptest::collection::vec(any::<u8>(), 0..40),
            fallback_type in proptest::option::of(any::<u16>()),
        ) {
            let text = ValueText {
                object: Object { index, sub },
                bytes: &bytes,
                length: bytes.len(),
                fallback_type,
            };
            prop_assert!(!text.to_string().is_empty());
        }

        #[test]
        fn sign_extension_is_twos_complement(value in any::<i64>(), bits in 1_usize..64) {
            let low = value.cast_unsigned() & (u64::MAX >> (64 - bits));
            let extended = sign_extended(low, bits);
            prop_assert_eq!(extended.cast_unsigned() & (u64::MAX >> (64 - bits)), low);
            prop_assert!(extended.unsigned_abs() <= 1 << (bits - 1));
        }
    }
}
