//! Stamp of a configuration (1020h; CiA 301, 7.5.2.23; CiA 302-2, 1F26h and 1F27h). It shows whether a node still has the
//! expected configuration.
//!
//! The standard defines date and time of the configuration. Here both are a checksum in that format, so equal writes
//! give equal stamps on every machine, without a clock.

use canopen_rs::Value;

use crate::object::Object;
use crate::sdo::bytes;

/// Content of 1020h after a configuration was stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// 1020h:1, in days since 1984-01-01: 1 to 65,535. A node that was never configured holds 0.
    pub date: u32,
    /// 1020h:2, in ms since midnight: 0 to 86,399,999.
    pub time: u32,
}

impl Stamp {
    /// Computes the stamp of a configuration from its writes, in their order.
    ///
    /// Hashes index (little-endian), sub-index, length and value of every write to h, by 64-bit FNV-1a. Date: 1 + h
    /// mod 65,535. Time: ⌊h / 65,535⌋ mod 86,400,000. There are 5.7·10¹² different stamps.
    pub fn from_writes<'a>(writes: impl IntoIterator<Item = &'a (Object, Value)>) -> Self {
        let mut hash = OFFSET_BASIS;
        let mut take = |byte: u8| hash = (hash ^ u64::from(byte)).wrapping_mul(PRIME);
        for (object, value) in writes {
            let value = bytes(value);
            let length = u8::try_from(value.len()).unwrap_or(u8::MAX);
            let [low, high] = object.index.to_le_bytes();
            [low, high, object.sub, length].into_iter().chain(value).for_each(&mut take);
        }
        let (days, rest) = (hash % DAYS, hash / DAYS);
        let part = |number: u64| u32::try_from(number).unwrap_or(0);
        Self { date: part(days + 1), time: part(rest % DAY_MS) }
    }
}

/// Offset basis of the 64-bit FNV-1a hash.
const OFFSET_BASIS: u64 = 0xCBF2_9CE4_8422_2325;
/// Prime of the 64-bit FNV-1a hash.
const PRIME: u64 = 0x0000_0100_0000_01B3;
/// Number of distinct dates.
const DAYS: u64 = 65_535;
/// Milliseconds per day.
const DAY_MS: u64 = 86_400_000;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::plans::elbow;

    #[test]
    fn stamp_of_a_configuration_never_changes() {
        let writes = [
            (Object::PRODUCER_HEARTBEAT, Value::Unsigned16(25)),
            (Object::MODE_OF_OPERATION, Value::Integer8(10)),
        ];
        // Computed by an independent program: FNV-1a of 17 10 00 02 19 00 60 60 00 01 0A.
        assert_eq!(Stamp::from_writes(&writes), Stamp { date: 60_297, time: 72_227_272 });
    }

    #[test]
    fn every_value_of_a_plan_changes_the_stamp() {
        let writes = elbow().writes();
        let stamp = Stamp::from_writes(&writes);
        for place in 0..writes.len() {
            let mut other = writes.clone();
            other[place].1 = Value::Unsigned32(0x1234_5678);
            assert_ne!(Stamp::from_writes(&other), stamp, "{}", writes[place].0);
            let mut fewer = writes.clone();
            fewer.remove(place);
            assert_ne!(Stamp::from_writes(&fewer), stamp, "{}", writes[place].0);
        }
    }

    proptest! {
        #[test]
        fn stamp_is_valid_and_never_zero(
            writes in proptest::collection::vec((any::<u16>(), any::<u8>(), any::<u32>()), 0..20),
        ) {
            let write = |(index, sub, raw)| (Object { index, sub }, Value::Unsigned32(raw));
            let writes: Vec<_> = writes.into_iter().map(write).collect();
            let Stamp { date, time } = Stamp::from_writes(&writes);
            prop_assert!((1..=65_535).contains(&date));
            prop_assert!(u64::from(time) < DAY_MS);
        }
    }
}
