//! Bit field in a frame. The eight bytes form one little-endian number (CiA 301, 7.2.2.5).

use crate::layout::{MappedObject, Service};

/// Position of a mapped object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slot {
    shift: u32,
    /// Mask of the field's bits in the content.
    mask: u64,
}

impl Slot {
    /// Returns the field of `content`, little-endian.
    pub(super) const fn read(self, content: u64) -> [u8; 8] {
        (content & self.mask).unbounded_shr(self.shift).to_le_bytes()
    }

    /// Returns `content` with `value` in the field.
    pub(super) const fn write(self, content: u64, value: u16) -> u64 {
        let [low, high] = value.to_le_bytes();
        let value = u64::from_le_bytes([low, high, 0, 0, 0, 0, 0, 0]);
        content & !self.mask | value.unbounded_shl(self.shift) & self.mask
    }

    /// Returns whether two fields share a bit.
    pub(super) const fn overlaps(self, other: Self) -> bool {
        self.mask & other.mask != 0
    }
}

/// Returns the mapped objects of a PDO with their fields. A field beyond 64 bits is empty.
pub(super) fn slots(service: &Service) -> impl Iterator<Item = (MappedObject, Slot)> + '_ {
    let mut shift = 0;
    service.mapping.iter().map(move |mapped| {
        let bits = u32::from(mapped.bits);
        let ones = u64::MAX.checked_shr(64 - bits.min(64)).unwrap_or(0);
        let slot = Slot { shift, mask: ones.checked_shl(shift).unwrap_or(0) };
        shift += bits;
        (*mapped, slot)
    })
}

/// Returns the data of a frame as one number.
pub(super) fn content(data: &[u8]) -> u64 {
    data.iter().take(8).rev().fold(0, |content, byte| content << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::object::Object;
    use crate::sync::TransmissionType;

    fn service(bits: &[u8]) -> Service {
        let mapping: Vec<_> = bits.iter().map(|bits| (Object::STATUSWORD, *bits)).collect();
        Service::new(TransmissionType::EVERY_SYNC, &mapping)
    }

    proptest! {
        #[test]
        fn written_value_is_read_and_other_fields_keep_theirs(before in any::<u64>(), value in any::<u16>()) {
            let service = service(&[16, 16, 16]);
            let slots: Vec<Slot> = slots(&service).map(|(_, slot)| slot).collect();
            let after = slots[1].write(before, value);
            prop_assert_eq!(slots[1].read(after)[..2].to_vec(), value.to_le_bytes().to_vec());
            for other in [slots[0], slots[2]] {
                prop_assert_eq!(other.read(after), other.read(before));
                prop_assert!(!other.overlaps(slots[1]));
            }
        }

        #[test]
        fn any_mapping_has_fields(
            bits in proptest::collection::vec(prop_oneof![0..=16_u8, any::<u8>()], 0..20), before in any::<u64>()
        ) {
            let service = service(&bits);
            let fields: Vec<Slot> = slots(&service).map(|(_, slot)| slot).collect();
            prop_assert_eq!(fields.len(), bits.len());
            let mut shift = 0_u32;
            for (bits, slot) in bits.iter().zip(&fields) {
                // The field ends with the frame.
                let size = u32::from(*bits).min(64_u32.saturating_sub(shift));
                let mask = u64::MAX.unbounded_shr(64 - size).unbounded_shl(shift);
                let value = before.unbounded_shr(shift) & u64::MAX.unbounded_shr(64 - size);
                prop_assert_eq!(slot.read(before), value.to_le_bytes(), "{} bits at {}", bits, shift);
                let written = before & !mask | 0xA5C3_u64.unbounded_shl(shift) & mask;
                prop_assert_eq!(slot.write(before, 0xA5C3), written, "{} bits at {}", bits, shift);
                shift += u32::from(*bits);
            }
        }
    }

    #[test]
    fn first_byte_is_the_lowest() {
        assert_eq!(content(&[0x37, 0x16, 0x01]), 0x01_1637);
    }
}
