//! Object dictionary of one device, from its EDS and node-id.
//!
//! The dictionary states the access rules; the SDO server applies them. Values are little-endian.

mod places;

use std::ops::RangeInclusive;

use crate::dictionary::places::Places;
use canopen::NodeId;
use canopen::data_type::{self, Kind};
use canopen::eds::{Access, Eds, EdsObject, value};
use canopen::object::Object;

/// Object with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    pub object: Object,
    /// Data type, by its number in CiA 301, 7.4.7.1.
    pub data_type: u16,
    /// Directions in which SDO and PDO may transfer the value.
    pub access: Access,
    /// Lowest valid value (`LowLimit` of the EDS); `None` without a limit.
    pub low: Option<i128>,
    /// Highest valid value (`HighLimit` of the EDS); `None` without a limit.
    pub high: Option<i128>,
    /// Set if it can be mapped into a PDO.
    pub is_mappable: bool,
    /// Set if the default contains the node-id.
    plus_node_id: bool,
    size: Option<usize>,
    value: Vec<u8>,
    default: Vec<u8>,
    /// Default of the manufacturer.
    factory: Vec<u8>,
}

/// Error of a value out of range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutOfRange {
    /// Below the low limit.
    Below,
    /// Above the high limit.
    Above,
}

impl Entry {
    /// Current value, little-endian as in SDO.
    pub fn value(&self) -> &[u8] {
        &self.value
    }

    /// Value after power-up.
    pub fn default(&self) -> &[u8] {
        &self.default
    }

    /// Size of a value in bytes; `None` for texts and domains.
    pub const fn size(&self) -> Option<usize> {
        self.size
    }

    /// Length in a PDO, in bits; `None` if it cannot be mapped.
    pub fn bits(&self) -> Option<u8> {
        data_type::find(self.data_type)?.bits.filter(|bits| *bits <= 64)
    }

    /// Checks the range of `value`, which has the right length.
    ///
    /// # Errors
    /// Returns the exceeded limit.
    pub fn in_range(&self, value: &[u8]) -> Result<(), OutOfRange> {
        let number = match data_type::find(self.data_type).map(|data_type| data_type.kind) {
            Some(Kind::Boolean | Kind::Unsigned) => value::unsigned(value),
            Some(Kind::Signed) => value::signed(value),
            Some(Kind::Real | Kind::Text | Kind::UnicodeText | Kind::Octets) | None => {
                return Ok(());
            }
        };
        if self.low.is_some_and(|low| number < low) {
            Err(OutOfRange::Below)
        } else if self.high.is_some_and(|high| number > high) {
            Err(OutOfRange::Above)
        } else {
            Ok(())
        }
    }
}

/// Objects of a device, by index and sub-index.
#[derive(Clone, Debug, PartialEq)]
pub struct Dictionary {
    entries: Vec<Entry>,
    /// Places of these entries.
    places: Places,
}

impl Dictionary {
    /// Returns the dictionary of a device after power-up. A device with 1021h (CiA 301, 7.5.2.24) stores its EDS,
    /// uncompressed (1022h is 0).
    pub fn new(eds: &Eds, node: NodeId) -> Self {
        let entries: Vec<Entry> =
            eds.objects().iter().map(|described| entry(described, node)).collect();
        let mut dictionary = Self { places: places(&entries), entries };
        if dictionary.unsigned(Object::STORE_FORMAT) == 0 {
            dictionary.set_default(Object::STORED_EDS, eds.source());
        }
        dictionary
    }

    /// Returns the entry of an object; `None` if it does not exist.
    pub fn entry(&self, object: Object) -> Option<&Entry> {
        self.entries.get(self.place(object)?)
    }

    /// Returns whether an object with this index exists.
    pub fn has_index(&self, index: u16) -> bool {
        self.entries.binary_search_by_key(&index, |entry| entry.object.index).is_ok()
    }

    /// Value of an object.
    pub fn get(&self, object: Object) -> Option<&[u8]> {
        self.entry(object).map(Entry::value)
    }

    /// Sets the value of an object regardless of its access. Returns false if it is absent or of another length.
    /// Allocates nothing for types of fixed length.
    pub fn set(&mut self, object: Object, value: &[u8]) -> bool {
        let Some(entry) = self.place(object).and_then(|place| self.entries.get_mut(place)) else {
            return false;
        };
        if entry.size().is_some_and(|size| size != value.len()) {
            return false;
        }
        if entry.value.len() == value.len() {
            entry.value.copy_from_slice(value);
        } else {
            entry.value.clear();
            entry.value.extend_from_slice(value);
        }
        true
    }

    /// Unsigned value of up to 32 bits; zero if the object is absent.
    pub fn unsigned(&self, object: Object) -> u32 {
        self.optional(object).unwrap_or_default()
    }

    /// Unsigned value of up to 32 bits; `None` if the object is absent.
    pub fn optional(&self, object: Object) -> Option<u32> {
        let value = self.get(object)?;
        let mut bytes = [0; 4];
        for (to, from) in bytes.iter_mut().zip(value) {
            *to = *from;
        }
        Some(u32::from_le_bytes(bytes))
    }

    /// Signed 16-bit value; zero if the object is absent or of another length.
    pub fn i16(&self, object: Object) -> i16 {
        let bytes = self.get(object).and_then(|value| value.try_into().ok());
        i16::from_le_bytes(bytes.unwrap_or_default())
    }

    /// Signed 8-bit value; zero if the object is absent or of another length.
    pub fn i8(&self, object: Object) -> i8 {
        let bytes = self.get(object).and_then(|value| value.try_into().ok());
        i8::from_le_bytes(bytes.unwrap_or_default())
    }

    /// Restores the defaults of these indices.
    pub fn restore(&mut self, indices: RangeInclusive<u16>) {
        for entry in self.entries.iter_mut().filter(|entry| indices.contains(&entry.object.index)) {
            entry.value.clone_from(&entry.default);
        }
    }

    /// Adapts defaults with a node-id to another node, for the next [`restore`](Self::restore). Values
    /// [stored](Self::keep) in their place stay.
    pub fn readdress(&mut self, from: NodeId, to: NodeId) {
        let shift = i128::from(to.raw()) - i128::from(from.raw());
        for entry in self.entries.iter_mut().filter(|entry| entry.plus_node_id) {
            let is_kept = entry.default != entry.factory;
            let number = value::unsigned(&entry.factory) + shift;
            for (byte, new) in entry.factory.iter_mut().zip(number.to_le_bytes()) {
                *byte = new;
            }
            if !is_kept {
                entry.default.clone_from(&entry.factory);
            }
        }
    }

    /// Sets value and default of an object that differs by device, such as the serial number. Returns false as
    /// [`set`](Self::set) does.
    pub fn set_default(&mut self, object: Object, value: &[u8]) -> bool {
        let is_set = self.set(object, value);
        if let Some(entry) = self.place(object).and_then(|place| self.entries.get_mut(place)) {
            entry.default.clone_from(&entry.value);
        }
        is_set
    }

    /// Sets value and default to the low bytes of `number`. Returns false if the object is absent or has more than four
    /// bytes.
    pub fn set_default_number(&mut self, object: Object, number: u32) -> bool {
        let bytes = number.to_le_bytes();
        let size = self.entry(object).and_then(Entry::size);
        let Some(value) = size.and_then(|size| bytes.get(..size)) else { return false };
        self.set_default(object, value)
    }

    /// Removes the limits of an object.
    pub fn remove_limits(&mut self, object: Object) {
        if let Some(entry) = self.place(object).and_then(|place| self.entries.get_mut(place)) {
            (entry.low, entry.high) = (None, None);
        }
    }

    /// Removes an object.
    pub fn remove(&mut self, object: Object) {
        self.entries.retain(|entry| entry.object != object);
        self.places = places(&self.entries);
    }

    /// Stores the values of the selected objects as their defaults.
    pub fn keep(&mut self, is_meant: impl Fn(Object, Access) -> bool) {
        for entry in self.entries.iter_mut().filter(|entry| is_meant(entry.object, entry.access)) {
            entry.default.clone_from(&entry.value);
        }
    }

    /// Restores the manufacturer's defaults of the selected objects.
    pub fn forget(&mut self, is_meant: impl Fn(Object, Access) -> bool) {
        for entry in self.entries.iter_mut().filter(|entry| is_meant(entry.object, entry.access)) {
            entry.default.clone_from(&entry.factory);
        }
    }

    fn place(&self, object: Object) -> Option<usize> {
        self.places.find(object, |place| Some(self.entries.get(place)?.object))
    }
}

fn places(entries: &[Entry]) -> Places {
    Places::new(entries.iter().map(|entry| entry.object))
}

fn entry(described: &EdsObject, node: NodeId) -> Entry {
    let value = described.initial(node);
    Entry {
        object: described.object,
        data_type: described.data_type,
        access: described.access,
        low: described.low.map(|low| low.resolve(node)),
        high: described.high.map(|high| high.resolve(node)),
        is_mappable: described.is_mappable,
        plus_node_id: described.number.is_some_and(|number| number.plus_node_id),
        size: data_type::size(described.data_type),
        default: value.clone(),
        factory: value.clone(),
        value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive() -> Dictionary {
        let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
        Dictionary::new(&eds, NodeId::new(5).unwrap())
    }

    #[test]
    fn node_id_is_added_to_defaults() {
        let dictionary = drive();
        assert_eq!(dictionary.unsigned(Object::EMCY_COB_ID), 0x85);
        assert_eq!(dictionary.unsigned(Object::rpdo_communication(1, 1)), 0x205);
        assert_eq!(dictionary.get(Object::DEVICE_NAME), Some(&b"frhc simulated drive"[..]));
    }

    #[test]
    fn changed_node_id_changes_defaults() {
        let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
        let mut dictionary = drive();
        let (five, nine) = (NodeId::new(5).unwrap(), NodeId::new(9).unwrap());
        dictionary.readdress(five, nine);
        assert_eq!(dictionary.unsigned(Object::EMCY_COB_ID), 0x85, "not before it is restored");
        dictionary.restore(0..=u16::MAX);
        assert_eq!(dictionary, Dictionary::new(&eds, nine));
        dictionary.readdress(nine, five);
        dictionary.restore(0..=u16::MAX);
        assert_eq!(dictionary, drive());
    }

    #[test]
    fn device_specific_default_survives_a_reset() {
        let mut dictionary = drive();
        assert!(dictionary.set_default(Object::SERIAL, &7_u32.to_le_bytes()));
        assert!(!dictionary.set_default(Object::SERIAL, &[7]), "of another length");
        dictionary.restore(0..=u16::MAX);
        assert_eq!(dictionary.unsigned(Object::SERIAL), 7);
    }

    #[test]
    fn every_object_is_at_its_place_after_others_are_removed() {
        let mut dictionary = drive();
        let all: Vec<Object> = dictionary.entries.iter().map(|entry| entry.object).collect();
        for removed in all.iter().step_by(3) {
            dictionary.remove(*removed);
        }
        for (place, object) in all.iter().enumerate() {
            let found = dictionary.entry(*object).map(|entry| entry.object);
            assert_eq!(found, (place % 3 != 0).then_some(*object));
        }
        assert_eq!(dictionary.entry(Object { index: 0x5FFF, sub: 0 }), None);
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
    fn changed_values_are_restored() {
        let mut dictionary = drive();
        assert!(dictionary.set(Object::PRODUCER_HEARTBEAT, &[25, 0]));
        assert!(dictionary.set(Object::ABORT_CONNECTION, &[1, 0]));
        dictionary.restore(0x1000..=0x1FFF);
        assert_eq!(dictionary.unsigned(Object::PRODUCER_HEARTBEAT), 0);
        assert_eq!(dictionary.i16(Object::ABORT_CONNECTION), 1);
        assert!(!dictionary.set(Object::PRODUCER_HEARTBEAT, &[1]), "of another length");
    }
}
