//! Value that a drive stores, read by SDO.

use derive_more::Display;

use crate::object::Object;
use crate::sdo::Content;

/// Value read from a drive, of one to four bytes.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
#[display("{object} = {value:0digits$X}h", digits = usize::from(2 * size))]
pub struct StoredValue {
    /// Object that was read.
    pub object: Object,
    /// Value, decoded from its little-endian bytes.
    pub value: u32,
    /// Number of bytes.
    pub size: u8,
}

impl StoredValue {
    /// Returns the content of an object; `None` unless it has one to four bytes. A reply of unknown size is cut to the size
    /// of the object, because the bytes behind it are meaningless.
    pub fn from_content(object: Object, content: &Content) -> Option<Self> {
        let size = match object {
            Object::POLARITY => 1,
            Object::POSITIVE_TORQUE_LIMIT | Object::NEGATIVE_TORQUE_LIMIT => 2,
            _ => 4,
        };
        Self::from_bytes(object, content.exactly(size).unwrap_or(content.bytes()))
    }

    fn from_bytes(object: Object, bytes: &[u8]) -> Option<Self> {
        let size = u8::try_from(bytes.len()).ok().filter(|size| (1..=4).contains(size))?;
        let value = bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
        Some(Self { object, value, size })
    }

    /// Returns whether the value may change while the drive runs, and matters then.
    pub fn may_change(&self) -> bool {
        ![Object::SUPPORTED_MODES, Object::ACCELERATION_UNIT].contains(&self.object)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_value_has_one_to_four_bytes() {
        let of = |bytes: &[u8]| {
            StoredValue::from_bytes(Object::POLARITY, bytes).map(|held| (held.value, held.size))
        };
        assert_eq!(of(&[0x80]), Some((0x80, 1)));
        assert_eq!(of(&[1, 2, 3, 4]), Some((0x0403_0201, 4)));
        assert_eq!((of(&[]), of(&[0; 5])), (None, None));
    }
}
