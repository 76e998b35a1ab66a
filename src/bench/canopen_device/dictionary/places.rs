//! Places of the objects in a dictionary: a hash table with open addressing.
//!
//! A drive accesses about thirty objects in every cycle. A binary search would compare seven of them for each.

use canopen::object::Object;

/// Slots for each object: half of them or more are empty, so that most objects are in their first slot.
const SLOTS_PER_OBJECT: usize = 2;

/// Multiplier of the hash: 2³² by the golden ratio (Knuth 1998, 6.4).
const MULTIPLIER: u32 = 0x9E37_79B1;

/// Places by object.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Places {
    /// Slots, a power of two.
    slots: Vec<Option<u16>>,
}

impl Places {
    /// Returns the places of `objects`, at most 65536.
    pub(super) fn new(objects: impl ExactSizeIterator<Item = Object>) -> Self {
        let count = (SLOTS_PER_OBJECT * objects.len()).next_power_of_two();
        let mut places = Self { slots: vec![None; count] };
        for (place, object) in (0..=u16::MAX).zip(objects) {
            let mut slots = places.from(object);
            let empty = slots.find(|slot| places.slots.get(*slot).is_some_and(Option::is_none));
            if let Some(slot) = empty.and_then(|slot| places.slots.get_mut(slot)) {
                *slot = Some(place);
            }
        }
        places
    }

    /// Returns the place of `object` among the same objects, which `at` returns by their places.
    pub(super) fn find(
        &self,
        object: Object,
        at: impl Fn(usize) -> Option<Object>,
    ) -> Option<usize> {
        for slot in self.from(object) {
            let place = usize::from((*self.slots.get(slot)?)?);
            if at(place)? == object {
                return Some(place);
            }
        }
        None
    }

    /// Returns the slots in the probe order of an object.
    fn from(&self, object: Object) -> impl Iterator<Item = usize> + use<> {
        let mask = self.slots.len() - 1;
        let number = u32::from(object.index) << 8 | u32::from(object.sub);
        let [_, _, low, high] = number.wrapping_mul(MULTIPLIER).to_le_bytes();
        let first = usize::from(u16::from_le_bytes([low, high]));
        (0..=mask).map(move |step| first.wrapping_add(step) & mask)
    }
}
