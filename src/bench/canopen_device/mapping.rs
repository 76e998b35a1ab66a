//! PDO mapping, resolved when it is configured (CiA 301, 7.5.2.36 and 7.5.2.38).
//!
//! The data of a PDO is one number of up to 64 bits; the first mapped object has the lowest bits.

use crate::dictionary::{Dictionary, Entry};
use canopen::abort::AbortCode;
use canopen::layout::Direction;
use canopen::object::Object;

/// Maximum objects per PDO.
const MAX_OBJECTS: usize = 8;

/// Maximum bits per PDO.
const MAX_BITS: u32 = 64;

/// Data types for dummy mapping of RPDOs, BOOLEAN to UNSIGNED32, with their length in bits.
const DUMMIES: [(u16, u8); 7] =
    [(0x0001, 1), (0x0002, 8), (0x0003, 16), (0x0004, 32), (0x0005, 8), (0x0006, 16), (0x0007, 32)];

/// Mapped object and its bits.
#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    /// Object; `None` for a dummy.
    object: Option<Object>,
    /// Lowest bit in the data of the PDO.
    shift: u32,
    /// Mask of its width.
    mask: u64,
    /// Size in the dictionary, in bytes.
    bytes: usize,
}

/// Objects of one PDO.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mapping {
    slots: [Slot; MAX_OBJECTS],
    used: usize,
    bits: u32,
}

impl Mapping {
    /// Resolves the mapping parameter `parameter` (its sub-index 0); empty if it is invalid.
    pub(super) fn resolve(
        dictionary: &Dictionary,
        parameter: Object,
        direction: Direction,
    ) -> Self {
        Self::resolve_entries(dictionary, parameter, byte(dictionary, parameter), direction)
            .unwrap_or_default()
    }

    /// Resolves the first `count` entries of the mapping parameter.
    pub(super) fn resolve_entries(
        dictionary: &Dictionary,
        parameter: Object,
        count: u8,
        direction: Direction,
    ) -> Result<Self, AbortCode> {
        let mut mapping = Self::default();
        for sub in 1..=count {
            let entry = Object { sub, ..parameter };
            if dictionary.entry(entry).is_none() {
                return Err(AbortCode::PDO_TOO_LONG);
            }
            let (object, bits) = mappable(dictionary, dictionary.unsigned(entry), direction)?;
            let slot = mapping.slots.get_mut(mapping.used).ok_or(AbortCode::PDO_TOO_LONG)?;
            let mask = u64::MAX.checked_shr(MAX_BITS - u32::from(bits)).unwrap_or(0);
            let bytes = usize::from(bits.div_ceil(8));
            *slot = Slot { object, shift: mapping.bits, mask, bytes };
            mapping.used += 1;
            mapping.bits += u32::from(bits);
            if mapping.bits > MAX_BITS {
                return Err(AbortCode::PDO_TOO_LONG);
            }
        }
        Ok(mapping)
    }

    /// Returns whether no object is mapped: the PDO is disabled.
    pub(super) const fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Length of its frame in bytes, 0 to 8.
    pub(super) fn bytes(&self) -> usize {
        usize::try_from(self.bits.div_ceil(8)).unwrap_or(0)
    }

    /// Mapped objects without dummies.
    pub(super) fn objects(&self) -> impl Iterator<Item = Object> {
        self.slots().filter_map(|slot| slot.object)
    }

    /// Packs the present values of the objects.
    pub(super) fn gather(&self, dictionary: &Dictionary) -> u64 {
        self.slots().fold(0, |content, slot| {
            let holds = slot.object.and_then(|object| dictionary.get(object)).unwrap_or_default();
            content | (number(holds) & slot.mask) << slot.shift
        })
    }

    /// Sets every object from `content`; a value outside its limits is skipped.
    pub(super) fn scatter(&self, content: u64, dictionary: &mut Dictionary) {
        for slot in self.slots() {
            let part = (content >> slot.shift & slot.mask).to_le_bytes();
            if let (Some(object), Some(bytes)) = (slot.object, part.get(..slot.bytes)) {
                let takes = |entry: &Entry| entry.in_range(bytes).is_ok();
                if dictionary.entry(object).is_some_and(takes) {
                    dictionary.set(object, bytes);
                }
            }
        }
    }

    fn slots(&self) -> impl Iterator<Item = &Slot> {
        self.slots.iter().take(self.used)
    }
}

/// Little-endian number of up to eight bytes; further bytes are ignored.
pub(super) fn number(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// Lowest byte of an object; zero if it is absent.
pub(super) fn byte(dictionary: &Dictionary, object: Object) -> u8 {
    let [lowest, ..] = dictionary.unsigned(object).to_le_bytes();
    lowest
}

/// Decodes a mapping entry: object (`None` for a dummy) and length in bits.
///
/// # Errors
/// Returns an abort code if the object is absent or cannot be mapped in this direction and length.
pub(super) fn mappable(
    dictionary: &Dictionary,
    entry: u32,
    direction: Direction,
) -> Result<(Option<Object>, u8), AbortCode> {
    let [bits, sub, low, high] = entry.to_le_bytes();
    let object = Object { index: u16::from_le_bytes([low, high]), sub };
    if direction == Direction::Receive && DUMMIES.contains(&(object.index, bits)) && sub == 0 {
        return Ok((None, bits));
    }
    if DUMMIES.iter().any(|(index, _)| *index == object.index) {
        return Err(AbortCode::NOT_MAPPABLE);
    }
    if !dictionary.has_index(object.index) {
        return Err(AbortCode::NO_OBJECT);
    }
    let entry = dictionary.entry(object).ok_or(AbortCode::NO_SUB_INDEX)?;
    let suits = match direction {
        Direction::Receive => entry.access.is_output(),
        Direction::Transmit => entry.access.is_input(),
    };
    if entry.is_mappable && suits && bits > 0 && entry.bits() == Some(bits) {
        Ok((Some(object), bits))
    } else {
        Err(AbortCode::NOT_MAPPABLE)
    }
}
