//! What may be written into a dictionary, and with which abort code it is refused (CiA 301, 7.5.2).

use crate::canopen::abort::AbortCode;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::dictionary::OutOfRange;
use crate::canopen::eds::Access;
use crate::canopen::object::Object;

/// Bit 31 of a PDO's COB-ID: the PDO does not exist.
pub(super) const INVALID: u32 = 1 << 31;

/// The bits of a COB-ID that are the identifier.
pub(super) const IDENTIFIER: u32 = 0x7FF;

/// Which of a PDO's objects an index is: its number from 1, its direction and whether it is the mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PdoObject {
    pub(super) number: u16,
    pub(super) is_transmit: bool,
    pub(super) is_mapping: bool,
}

impl PdoObject {
    /// `None` for an index that is of no PDO.
    pub(super) const fn of(index: u16) -> Option<Self> {
        let number = (index & 0x1FF) + 1;
        let (is_transmit, is_mapping) = match index {
            0x1400..=0x15FF => (false, false),
            0x1600..=0x17FF => (false, true),
            0x1800..=0x19FF => (true, false),
            0x1A00..=0x1BFF => (true, true),
            _ => return None,
        };
        Some(Self { number, is_transmit, is_mapping })
    }

    /// Sub-index `sub` of the communication parameter.
    pub(super) const fn communication(self, sub: u8) -> Object {
        if self.is_transmit {
            Object::tpdo_communication(self.number, sub)
        } else {
            Object::rpdo_communication(self.number, sub)
        }
    }

    /// Sub-index `sub` of the mapping parameter.
    pub(super) const fn mapping(self, sub: u8) -> Object {
        if self.is_transmit {
            Object::tpdo_mapping(self.number, sub)
        } else {
            Object::rpdo_mapping(self.number, sub)
        }
    }
}

/// Whether an object is there.
pub(super) fn exists(dictionary: &Dictionary, object: Object) -> Result<(), AbortCode> {
    match dictionary.entry(object) {
        Some(_) => Ok(()),
        None if dictionary.has_index(object.index) => Err(AbortCode::NO_SUB_INDEX),
        None => Err(AbortCode::NO_OBJECT),
    }
}

/// Whether `value` may be written to an object that is there and writable.
pub(super) fn takes(
    dictionary: &Dictionary,
    object: Object,
    value: &[u8],
) -> Result<(), AbortCode> {
    let entry = dictionary.entry(object).ok_or(AbortCode::NO_OBJECT)?;
    if let Some(size) = entry.size() {
        if value.len() > size {
            return Err(AbortCode::LENGTH_TOO_HIGH);
        }
        if value.len() < size {
            return Err(AbortCode::LENGTH_TOO_LOW);
        }
    }
    entry.in_range(value).map_err(|outside| match outside {
        OutOfRange::Below => AbortCode::VALUE_TOO_LOW,
        OutOfRange::Above => AbortCode::VALUE_TOO_HIGH,
    })?;
    match PdoObject::of(object.index) {
        Some(pdo) if pdo.is_mapping => mapping(dictionary, pdo, object.sub, value),
        Some(pdo) => communication(dictionary, pdo, object.sub, value),
        None if object == Object::ERROR_HISTORY && value != [0] => Err(AbortCode::VALUE_INVALID),
        None => Ok(()),
    }
}

/// A PDO's communication parameter (7.5.2.35, 7.5.2.37).
fn communication(
    dictionary: &Dictionary,
    pdo: PdoObject,
    sub: u8,
    value: &[u8],
) -> Result<(), AbortCode> {
    let is_valid = dictionary.unsigned(pdo.communication(1)) & INVALID == 0;
    match (sub, value) {
        (1, &[a, b, c, d]) => {
            let new = u32::from_le_bytes([a, b, c, d]);
            let old = dictionary.unsigned(pdo.communication(1));
            let moves = (new ^ old) & !INVALID != 0;
            // An identifier moves only while the PDO does not exist, before or after the write.
            if is_valid && new & INVALID == 0 && moves {
                return Err(AbortCode::VALUE_INVALID);
            }
            let identifier = new & IDENTIFIER;
            let is_extended = new & 1 << 29 != 0;
            if new & INVALID == 0 && (is_extended || is_restricted(identifier)) {
                return Err(AbortCode::VALUE_INVALID);
            }
            Ok(())
        }
        (2, [241..=251]) => Err(AbortCode::VALUE_INVALID),
        (3, _) if is_valid => Err(AbortCode::ACCESS_UNSUPPORTED),
        _ => Ok(()),
    }
}

/// Identifiers no PDO may have (7.3.5, table 40).
const fn is_restricted(identifier: u32) -> bool {
    matches!(
        identifier,
        0x000..=0x07F | 0x080 | 0x100..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF
            | 0x701..=0x77F | 0x780..=0x7FF
    )
}

/// A PDO's mapping (7.5.2.36, 7.5.2.38): changed only while the PDO does not exist, entries only while
/// none is counted.
fn mapping(
    dictionary: &Dictionary,
    pdo: PdoObject,
    sub: u8,
    value: &[u8],
) -> Result<(), AbortCode> {
    if dictionary.unsigned(pdo.communication(1)) & INVALID == 0 {
        return Err(AbortCode::ACCESS_UNSUPPORTED);
    }
    match (sub, value) {
        (0, &[count]) => {
            let mut bits = 0;
            for sub in 1..=count {
                let mapped = dictionary.unsigned(pdo.mapping(sub));
                may_map(dictionary, pdo, mapped)?;
                bits += mapped & 0xFF;
            }
            if bits > 64 { Err(AbortCode::PDO_TOO_LONG) } else { Ok(()) }
        }
        (_, &[a, b, c, d]) => {
            if dictionary.unsigned(pdo.mapping(0)) != 0 {
                return Err(AbortCode::ACCESS_UNSUPPORTED);
            }
            match u32::from_le_bytes([a, b, c, d]) {
                0 => Ok(()),
                mapped => may_map(dictionary, pdo, mapped),
            }
        }
        _ => Ok(()),
    }
}

/// Whether an object may stand in a PDO, with so many bits. Indices 1 to 7 of an RPDO are dummies that
/// skip their bits.
fn may_map(dictionary: &Dictionary, pdo: PdoObject, mapped: u32) -> Result<(), AbortCode> {
    let [bits, sub, i0, i1] = mapped.to_le_bytes();
    let object = Object { index: u16::from_le_bytes([i0, i1]), sub };
    if let Some(dummy) = dummy_bits(object) {
        let fits = !pdo.is_transmit && dummy == bits;
        return if fits { Ok(()) } else { Err(AbortCode::NOT_MAPPABLE) };
    }
    exists(dictionary, object)?;
    let entry = dictionary.entry(object).ok_or(AbortCode::NO_OBJECT)?;
    let access: Access = entry.access;
    let goes = if pdo.is_transmit { access.is_input() } else { access.is_output() };
    if entry.is_mappable && goes && entry.bits() == Some(bits) {
        Ok(())
    } else {
        Err(AbortCode::NOT_MAPPABLE)
    }
}

/// The bits of a dummy, `None` for every other object (7.4.7.1: data types 2 to 7).
pub(super) const fn dummy_bits(object: Object) -> Option<u8> {
    match object {
        Object { index: 2 | 5, sub: 0 } => Some(8),
        Object { index: 3 | 6, sub: 0 } => Some(16),
        Object { index: 4 | 7, sub: 0 } => Some(32),
        _ => None,
    }
}
