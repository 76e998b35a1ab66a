//! Communication and mapping parameters of PDOs: addresses and write rules (CiA 301, 7.5.2.35 to 7.5.2.38).
//!
//! A mapping changes only while its PDO is disabled and its number of entries is zero. An enabled PDO keeps its
//! COB-ID.

use crate::dictionary::Dictionary;
use crate::mapping::{Mapping, byte, mappable, number};
use canopen::abort::AbortCode;
use canopen::frame::COB_ID_MAX;
use canopen::layout::{Direction, MAX_PDOS};
use canopen::object::Object;
use canopen::sync::{self, TransmissionType};

/// PDO of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) direction: Direction,
    /// PDO number, from 1.
    pub(super) number: u16,
}

impl Place {
    /// Returns the PDO that `object` is a parameter of.
    pub(super) fn from_parameter(object: Object) -> Option<Self> {
        let (direction, first) = match object.index {
            0x1400..=0x15FF => (Direction::Receive, 0x1400),
            0x1600..=0x17FF => (Direction::Receive, 0x1600),
            0x1800..=0x19FF => (Direction::Transmit, 0x1800),
            0x1A00..=0x1BFF => (Direction::Transmit, 0x1A00),
            _ => return None,
        };
        Some(Self { direction, number: object.index - first + 1 })
    }

    /// PDOs in the dictionary of a device, up to 512 per direction.
    pub(super) fn all(
        dictionary: &Dictionary,
        direction: Direction,
    ) -> impl Iterator<Item = Self> + '_ {
        let places = (1..=MAX_PDOS).map(move |number| Self { direction, number });
        places.filter(|place| dictionary.entry(place.communication(1)).is_some())
    }

    /// Sub-index `sub` of the communication parameter.
    pub(super) const fn communication(self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_communication(self.number, sub),
            Direction::Transmit => Object::tpdo_communication(self.number, sub),
        }
    }

    /// Sub-index `sub` of the mapping parameter.
    pub(super) const fn mapping(self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_mapping(self.number, sub),
            Direction::Transmit => Object::tpdo_mapping(self.number, sub),
        }
    }

    /// COB-ID; `None` while the PDO is disabled or absent.
    pub(super) fn cob_id(self, dictionary: &Dictionary) -> Option<u16> {
        let object = self.communication(1);
        dictionary.entry(object)?;
        cob_id(dictionary.unsigned(object))
    }

    /// Transmission type, sub-index 2.
    pub(super) fn transmission(self, dictionary: &Dictionary) -> TransmissionType {
        TransmissionType(byte(dictionary, self.communication(2)))
    }

    /// Mapping by its mapping parameter.
    pub(super) fn resolve(self, dictionary: &Dictionary) -> Mapping {
        Mapping::resolve(dictionary, self.mapping(0), self.direction)
    }

    /// Checks a write to one of its parameters. `bytes` have the size of the object.
    ///
    /// # Errors
    /// Returns the abort code of a refused write.
    pub(super) fn check_write(
        self,
        dictionary: &Dictionary,
        object: Object,
        bytes: &[u8],
    ) -> Result<(), AbortCode> {
        let is_on = self.cob_id(dictionary).is_some();
        let while_off = if is_on { Err(AbortCode::DEVICE_STATE) } else { Ok(()) };
        let value = u32::try_from(number(bytes)).map_err(|_| AbortCode::VALUE_INVALID)?;
        if object.index == self.communication(0).index {
            return match (object.sub, bytes) {
                (1, _) => check_cob_id_change(dictionary.unsigned(object), value),
                (2, [kind]) => self.check_transmission(dictionary, TransmissionType(*kind)),
                (3 | 6, _) => while_off,
                _ => Ok(()),
            };
        }
        while_off?;
        match (object.sub, bytes) {
            (0, [count]) => {
                Mapping::resolve_entries(dictionary, self.mapping(0), *count, self.direction)
                    .map(|_| ())
            }
            (0, _) => Err(AbortCode::VALUE_INVALID),
            _ if byte(dictionary, self.mapping(0)) != 0 => Err(AbortCode::ACCESS_UNSUPPORTED),
            _ if value == 0 => Ok(()),
            _ => mappable(dictionary, value, self.direction).map(|_| ()),
        }
    }

    /// Checks a transmission type. Types on request need a TPDO that answers remote frames.
    fn check_transmission(
        self,
        dictionary: &Dictionary,
        kind: TransmissionType,
    ) -> Result<(), AbortCode> {
        let answers = self.direction == Direction::Transmit
            && dictionary.unsigned(self.communication(1)) & NO_REMOTE == 0;
        let is_possible = match kind {
            TransmissionType::SYNC_ON_REQUEST | TransmissionType::ON_REQUEST => answers,
            kind => kind.syncs().is_some() || kind.is_event_driven(),
        };
        if is_possible { Ok(()) } else { Err(AbortCode::VALUE_INVALID) }
    }
}

/// Bit 30 of a TPDO's COB-ID: no remote frames.
pub(super) const NO_REMOTE: u32 = 1 << 30;
/// Bit 31 of a COB-ID: the service is disabled.
const OFF: u32 = 1 << 31;
/// Bit 29: extended 29-bit identifier.
const EXTENDED: u32 = 1 << 29;

/// Identifier of a COB-ID entry; `None` while the service is disabled or the identifier has 29 bits.
pub(super) fn cob_id(raw: u32) -> Option<u16> {
    if raw & (OFF | EXTENDED) != 0 {
        return None;
    }
    u16::try_from(raw & u32::from(COB_ID_MAX)).ok().filter(|cob_id| !is_reserved(*cob_id))
}

/// Checks a change of a COB-ID entry from `old` to `new`. Disabling is always allowed, enabling only with a free
/// identifier, and an enabled one must not change.
///
/// # Errors
/// Returns the abort code of a refused change.
pub(super) fn check_cob_id_change(old: u32, new: u32) -> Result<(), AbortCode> {
    if new & ABOVE_11_BITS != 0 {
        return Err(AbortCode::VALUE_INVALID);
    }
    if new & OFF != 0 {
        return Ok(());
    }
    let Some(identifier) = cob_id(new) else { return Err(AbortCode::VALUE_INVALID) };
    match cob_id(old) {
        Some(before) if before != identifier => Err(AbortCode::DEVICE_STATE),
        Some(_) | None => Ok(()),
    }
}

/// Identifier of SYNC or TIME, which no device here produces (bit 30).
///
/// # Errors
/// Returns an abort code if bit 30 is set, or the identifier has 29 bits or belongs to another service.
pub(super) fn consumed(raw: u32) -> Result<u16, AbortCode> {
    let is_free = |cob_id: &u16| !is_reserved(*cob_id) || *cob_id == sync::COB_ID;
    let identifier = u16::try_from(raw & u32::from(COB_ID_MAX)).ok().filter(is_free);
    let is_possible = raw & (PRODUCES | ABOVE_11_BITS) == 0;
    identifier.filter(|_| is_possible).ok_or(AbortCode::VALUE_INVALID)
}

/// Bit 30 of the COB-ID of SYNC or TIME: the device produces it.
const PRODUCES: u32 = 1 << 30;
/// Bits 11 to 28 of a COB-ID, and bit 29, which makes them part of the identifier.
const ABOVE_11_BITS: u32 = 0x3FFF_F800;

/// Returns whether an identifier is restricted for PDOs and emergencies (CiA 301, 7.3.5).
const fn is_reserved(cob_id: u16) -> bool {
    matches!(cob_id, 0..=0x80 | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=COB_ID_MAX)
}
