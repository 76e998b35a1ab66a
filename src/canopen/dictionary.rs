//! An object dictionary: what one device holds, as its EDS describes it and its node-id completes it.
//!
//! Not who may write what over which service: the dictionary says what the rules are, the
//! [SDO server](crate::canopen::device) keeps them. Values are little-endian bytes, as on the wire.

use std::ops::RangeInclusive;

use crate::canopen::NodeId;
use crate::canopen::eds::Access;
use crate::canopen::eds::Described;
use crate::canopen::eds::Eds;
use crate::canopen::object::Object;

/// One object and what it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Which.
    pub object: Object,
    /// Data type, by its number in CiA 301, 7.4.7.1.
    pub data_type: u16,
    /// Who may do what with it.
    pub access: Access,
    /// The lowest value it takes.
    pub low: Option<i64>,
    /// The highest value it takes.
    pub high: Option<i64>,
    /// Whether it may be mapped into a PDO.
    pub is_mappable: bool,
    value: Vec<u8>,
    default: Vec<u8>,
    /// The maker's.
    factory: Vec<u8>,
}

/// Why a value is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutOfRange {
    /// Below the lowest.
    Below,
    /// Above the highest.
    Above,
}

impl Entry {
    /// What it holds.
    pub fn value(&self) -> &[u8] {
        &self.value
    }

    /// What it holds after power-up.
    pub fn default(&self) -> &[u8] {
        &self.default
    }

    /// The bytes a value of its type has; `None` for texts and domains.
    pub const fn size(&self) -> Option<usize> {
        size(self.data_type)
    }

    /// The bits it takes in a PDO; `None` for what cannot be in one.
    pub fn bits(&self) -> Option<u8> {
        u8::try_from(self.size()? * 8).ok().filter(|bits| *bits <= 64)
    }

    /// Whether `value`, of the right length, is one it takes.
    ///
    /// # Errors
    /// On which side it lies outside.
    pub fn in_range(&self, value: &[u8]) -> Result<(), OutOfRange> {
        if self.size().is_none() {
            return Ok(());
        }
        let number = number(self.data_type, value);
        if self.low.is_some_and(|low| number < i128::from(low)) {
            Err(OutOfRange::Below)
        } else if self.high.is_some_and(|high| number > i128::from(high)) {
            Err(OutOfRange::Above)
        } else {
            Ok(())
        }
    }
}

/// All objects of a device, by index and sub-index.
#[derive(Clone, Debug, PartialEq)]
pub struct Dictionary {
    entries: Vec<Entry>,
}

impl Dictionary {
    /// As the device is after power-up, as `node`.
    pub fn new(eds: &Eds, node: NodeId) -> Self {
        Self { entries: eds.objects().iter().map(|described| entry(described, node)).collect() }
    }

    /// One object.
    pub fn entry(&self, object: Object) -> Option<&Entry> {
        self.entries.get(self.place(object)?)
    }

    /// Whether there is any object of this index.
    pub fn has_index(&self, index: u16) -> bool {
        self.entries.binary_search_by_key(&index, |entry| entry.object.index).is_ok()
    }

    /// What an object holds.
    pub fn get(&self, object: Object) -> Option<&[u8]> {
        self.entry(object).map(Entry::value)
    }

    /// Makes an object hold `value`, whoever may write it; false if it is not there or of another
    /// length. Allocates nothing for types of fixed length.
    pub fn set(&mut self, object: Object, value: &[u8]) -> bool {
        let Some(entry) = self.place(object).and_then(|place| self.entries.get_mut(place)) else {
            return false;
        };
        if entry.size().is_some_and(|size| size != value.len()) {
            return false;
        }
        entry.value.clear();
        entry.value.extend_from_slice(value);
        true
    }

    /// An unsigned number of up to 32 bits; zero if the object is not there.
    pub fn unsigned(&self, object: Object) -> u32 {
        let mut bytes = [0; 4];
        for (to, from) in bytes.iter_mut().zip(self.get(object).unwrap_or_default()) {
            *to = *from;
        }
        u32::from_le_bytes(bytes)
    }

    /// A signed number of 16 bits; zero if the object is not there or of another length.
    pub fn i16(&self, object: Object) -> i16 {
        let bytes = self.get(object).and_then(|value| value.try_into().ok());
        i16::from_le_bytes(bytes.unwrap_or_default())
    }

    /// A signed number of 8 bits; zero if the object is not there or of another length.
    pub fn i8(&self, object: Object) -> i8 {
        let bytes = self.get(object).and_then(|value| value.try_into().ok());
        i8::from_le_bytes(bytes.unwrap_or_default())
    }

    /// Every object of these indices holds again what it held after power-up.
    pub fn restore(&mut self, indices: RangeInclusive<u16>) {
        for entry in self.entries.iter_mut().filter(|entry| indices.contains(&entry.object.index)) {
            entry.value.clone_from(&entry.default);
        }
    }

    /// What the objects that `is_meant` picks hold now is what they hold after power-up.
    pub fn keep(&mut self, is_meant: impl Fn(Object, Access) -> bool) {
        for entry in self.entries.iter_mut().filter(|entry| is_meant(entry.object, entry.access)) {
            entry.default.clone_from(&entry.value);
        }
    }

    /// What the maker gave the objects that `is_meant` picks is again what they hold after power-up.
    pub fn forget(&mut self, is_meant: impl Fn(Object, Access) -> bool) {
        for entry in self.entries.iter_mut().filter(|entry| is_meant(entry.object, entry.access)) {
            entry.default.clone_from(&entry.factory);
        }
    }

    fn place(&self, object: Object) -> Option<usize> {
        self.entries.binary_search_by_key(&object, |entry| entry.object).ok()
    }
}

fn entry(described: &Described, node: NodeId) -> Entry {
    let value = match (size(described.data_type), described.number) {
        (Some(size), number) => {
            let number = number.map_or(0, |number| number.resolve(node));
            number.to_le_bytes().get(..size).unwrap_or_default().to_vec()
        }
        (None, _) => described.default.as_bytes().to_vec(),
    };
    Entry {
        object: described.object,
        data_type: described.data_type,
        access: described.access,
        low: described.low,
        high: described.high,
        is_mappable: described.is_mappable,
        default: value.clone(),
        factory: value.clone(),
        value,
    }
}

/// The bytes of a type (CiA 301, 7.4.7.1); `None` for those of any length.
const fn size(data_type: u16) -> Option<usize> {
    match data_type {
        0x01 | 0x02 | 0x05 => Some(1),
        0x03 | 0x06 => Some(2),
        0x10 | 0x16 => Some(3),
        0x04 | 0x07 | 0x08 => Some(4),
        0x12 | 0x18 => Some(5),
        0x13 | 0x19 => Some(6),
        0x14 | 0x1A => Some(7),
        0x11 | 0x15 | 0x1B => Some(8),
        _ => None,
    }
}

/// A whole number of a type. Reals have no limits here and count as zero.
fn number(data_type: u16, value: &[u8]) -> i128 {
    let is_signed = matches!(data_type, 0x02 | 0x03 | 0x04 | 0x10 | 0x12..=0x15);
    let is_real = matches!(data_type, 0x08 | 0x11);
    if is_real {
        return 0;
    }
    let is_negative = is_signed && value.last().is_some_and(|high| *high & 0x80 != 0);
    let mut bytes = if is_negative { [0xFF; 16] } else { [0; 16] };
    for (to, from) in bytes.iter_mut().zip(value) {
        *to = *from;
    }
    i128::from_le_bytes(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive() -> Dictionary {
        let eds = Eds::parse(include_bytes!("../../eds/frhc_drive.eds")).unwrap();
        Dictionary::new(&eds, NodeId::new(5).unwrap())
    }

    #[test]
    fn the_node_id_completes_what_depends_on_it() {
        let dictionary = drive();
        assert_eq!(dictionary.unsigned(Object::EMCY_COB_ID), 0x85);
        assert_eq!(dictionary.unsigned(Object::rpdo_communication(1, 1)), 0x205);
        assert_eq!(dictionary.get(Object::DEVICE_NAME), Some(&b"frhc simulated drive"[..]));
    }

    #[test]
    fn limits_are_those_of_the_type() {
        let dictionary = drive();
        let torque = dictionary.entry(Object::TARGET_TORQUE).unwrap();
        assert_eq!(torque.in_range(&3_000_i16.to_le_bytes()), Ok(()));
        assert_eq!(torque.in_range(&3_001_i16.to_le_bytes()), Err(OutOfRange::Above));
        assert_eq!(torque.in_range(&(-3_001_i16).to_le_bytes()), Err(OutOfRange::Below));
        let max = dictionary.entry(Object::MAX_TORQUE).unwrap();
        assert_eq!(max.in_range(&0xFFFF_u16.to_le_bytes()), Err(OutOfRange::Above));
    }

    #[test]
    fn what_was_changed_is_restored() {
        let mut dictionary = drive();
        assert!(dictionary.set(Object::PRODUCER_HEARTBEAT, &[25, 0]));
        assert!(dictionary.set(Object::ABORT_CONNECTION, &[1, 0]));
        dictionary.restore(0x1000..=0x1FFF);
        assert_eq!(dictionary.unsigned(Object::PRODUCER_HEARTBEAT), 0);
        assert_eq!(dictionary.i16(Object::ABORT_CONNECTION), 1);
        assert!(!dictionary.set(Object::PRODUCER_HEARTBEAT, &[1]), "of another length");
    }
}
