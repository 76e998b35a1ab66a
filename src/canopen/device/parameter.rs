//! The communication and mapping parameters of the PDOs: which there are, and which writes they take
//! (CiA 301, 7.5.2.35 to 7.5.2.38).
//!
//! Only the rules. A mapping changes while its PDO is off and its number of entries is zero; a PDO
//! that is on keeps its identifier.

use crate::abort::AbortCode;
use crate::device::mapping::Mapping;
use crate::device::mapping::byte;
use crate::device::mapping::mappable;
use crate::device::mapping::number;
use crate::dictionary::Dictionary;
use crate::frame::COB_ID_MAX;
use crate::layout::Direction;
use crate::layout::MOST_PDOS;
use crate::object::Object;
use crate::sync;
use crate::sync::Transmission;

/// One PDO of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) direction: Direction,
    /// From 1.
    pub(super) number: u16,
}

impl Place {
    /// The PDO that `object` is a parameter of, if it is one.
    pub(super) fn of(object: Object) -> Option<Self> {
        let (direction, first) = match object.index {
            0x1400..=0x15FF => (Direction::Receive, 0x1400),
            0x1600..=0x17FF => (Direction::Receive, 0x1600),
            0x1800..=0x19FF => (Direction::Transmit, 0x1800),
            0x1A00..=0x1BFF => (Direction::Transmit, 0x1A00),
            _ => return None,
        };
        Some(Self { direction, number: object.index - first + 1 })
    }

    /// The PDOs a device has, by its dictionary, up to 512 each way.
    pub(super) fn all(
        dictionary: &Dictionary,
        direction: Direction,
    ) -> impl Iterator<Item = Self> + '_ {
        let places = (1..=MOST_PDOS).map(move |number| Self { direction, number });
        places.filter(|place| dictionary.entry(place.communication(1)).is_some())
    }

    /// Sub-index `sub` of its communication parameter.
    pub(super) const fn communication(self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_communication(self.number, sub),
            Direction::Transmit => Object::tpdo_communication(self.number, sub),
        }
    }

    /// Sub-index `sub` of its mapping parameter.
    pub(super) const fn mapping(self, sub: u8) -> Object {
        match self.direction {
            Direction::Receive => Object::rpdo_mapping(self.number, sub),
            Direction::Transmit => Object::tpdo_mapping(self.number, sub),
        }
    }

    /// Its identifier; `None` while it is off, or where there is no such PDO.
    pub(super) fn cob_id(self, dictionary: &Dictionary) -> Option<u16> {
        let object = self.communication(1);
        dictionary.entry(object)?;
        cob_id(dictionary.unsigned(object))
    }

    /// Its transmission type.
    pub(super) fn transmission(self, dictionary: &Dictionary) -> Transmission {
        Transmission(byte(dictionary, self.communication(2)))
    }

    /// What its mapping parameter says.
    pub(super) fn resolve(self, dictionary: &Dictionary) -> Mapping {
        Mapping::resolve(dictionary, self.mapping(0), self.direction)
    }

    /// Whether one of its parameters may be written now. `bytes` have the size of the object.
    ///
    /// # Errors
    /// When it may not, and why.
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
                (1, _) => may_change_cob_id(dictionary.unsigned(object), value),
                (2, [kind]) => self.may_be(dictionary, Transmission(*kind)),
                (3 | 6, _) => while_off,
                _ => Ok(()),
            };
        }
        while_off?;
        match (object.sub, bytes) {
            (0, [count]) => {
                Mapping::of(dictionary, self.mapping(0), *count, self.direction).map(|_| ())
            }
            (0, _) => Err(AbortCode::VALUE_INVALID),
            _ if byte(dictionary, self.mapping(0)) != 0 => Err(AbortCode::ACCESS_UNSUPPORTED),
            _ if value == 0 => Ok(()),
            _ => mappable(dictionary, value, self.direction).map(|_| ()),
        }
    }

    /// Whether it may be of this transmission type. Only a TPDO that answers remote frames waits for them.
    fn may_be(self, dictionary: &Dictionary, kind: Transmission) -> Result<(), AbortCode> {
        let answers = self.direction == Direction::Transmit
            && dictionary.unsigned(self.communication(1)) & NO_REMOTE == 0;
        let is_possible = match kind {
            Transmission::SYNC_ON_REQUEST | Transmission::ON_REQUEST => answers,
            kind => kind.syncs().is_some() || kind.is_event_driven(),
        };
        if is_possible { Ok(()) } else { Err(AbortCode::VALUE_INVALID) }
    }
}

/// Bit 30 of a TPDO's COB-ID: remote frames are not answered.
pub(super) const NO_REMOTE: u32 = 1 << 30;
/// Bit 31 of a COB-ID: the service is off.
const OFF: u32 = 1 << 31;
/// Bit 29: an identifier of 29 bits.
const EXTENDED: u32 = 1 << 29;

/// The identifier of a COB-ID entry; `None` while its service is off, or on with 29 bits.
pub(super) fn cob_id(raw: u32) -> Option<u16> {
    if raw & (OFF | EXTENDED) != 0 {
        return None;
    }
    u16::try_from(raw & u32::from(COB_ID_MAX)).ok().filter(|cob_id| !is_reserved(*cob_id))
}

/// Whether a COB-ID entry that holds `old` may become `new`: switched off always, on only with an
/// identifier that is free, and never changed while on.
///
/// # Errors
/// When it may not, and why.
pub(super) fn may_change_cob_id(old: u32, new: u32) -> Result<(), AbortCode> {
    if new & BEYOND_11_BITS != 0 {
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

/// The identifier of SYNC or TIME, whose bit 30 says that the device makes it, which none here does.
///
/// # Errors
/// When bit 30 is set, or the identifier has 29 bits or is another service's.
pub(super) fn consumed(raw: u32) -> Result<u16, AbortCode> {
    let is_free = |cob_id: &u16| !is_reserved(*cob_id) || *cob_id == sync::COB_ID;
    let identifier = u16::try_from(raw & u32::from(COB_ID_MAX)).ok().filter(is_free);
    let is_possible = raw & (PRODUCES | BEYOND_11_BITS) == 0;
    identifier.filter(|_| is_possible).ok_or(AbortCode::VALUE_INVALID)
}

/// Bit 30 of the COB-ID of SYNC or TIME: the device makes it.
const PRODUCES: u32 = 1 << 30;
/// Bits 11 to 28 of a COB-ID, and bit 29, which says that they count.
const BEYOND_11_BITS: u32 = 0x3FFF_F800;

/// Identifiers that no PDO or emergency may take (CiA 301, 7.3.5).
const fn is_reserved(cob_id: u16) -> bool {
    matches!(cob_id, 0..=0x80 | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=COB_ID_MAX)
}
