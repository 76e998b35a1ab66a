//! SYNC and the transmission types of PDOs (CiA 301, 7.2.5 and 7.5.2.38).
//!
//! The cycle decides when a SYNC is sent. A synchronous TPDO is sampled and sent at the SYNC; a synchronous
//! RPDO acts at the next one.

use std::fmt;

use crate::frame::Frame;

/// COB-ID of the predefined connection set.
pub const COB_ID: u16 = 0x80;

/// SYNC message, with an optional counter of 1 to 240 (1019h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sync {
    /// Counter value, if SYNCs are counted.
    pub counter: Option<u8>,
}

impl Sync {
    /// Decodes a SYNC; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<Self> {
        match (frame.cob_id, frame.data()) {
            (COB_ID, []) => Some(Self { counter: None }),
            (COB_ID, [counter]) => Some(Self { counter: Some(*counter) }),
            _ => None,
        }
    }

    /// Encodes the SYNC.
    pub fn frame(self) -> Frame {
        match self.counter {
            None => Frame::new(COB_ID, []),
            Some(counter) => Frame::new(COB_ID, [counter]),
        }
    }
}

/// SYNC counter: runs from 1 to the synchronous counter overflow value (1019h), then restarts at 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counter {
    overflow: Option<u8>,
    last: u8,
}

impl Counter {
    /// Returns a counter up to `overflow`, 2 to 240; `None` disables counting.
    pub const fn new(overflow: Option<u8>) -> Self {
        Self { overflow, last: 0 }
    }

    /// Returns the SYNC to send now, and advances the counter.
    pub const fn next(&mut self) -> Sync {
        let Some(overflow) = self.overflow else { return Sync { counter: None } };
        self.last = if self.last >= overflow { 1 } else { self.last + 1 };
        Sync { counter: Some(self.last) }
    }

    /// Restarts at 1, as at every start of the network.
    pub const fn restart(&mut self) {
        self.last = 0;
    }
}

/// Transmission type of a PDO: sub-index 2 of its communication parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TransmissionType(pub u8);

impl TransmissionType {
    /// Acyclic synchronous: at the SYNC after a change.
    pub const SYNC_ON_CHANGE: Self = Self(0);
    /// Cyclic synchronous: at every SYNC.
    pub const EVERY_SYNC: Self = Self(1);
    /// Sampled at every SYNC, sent on a remote frame.
    pub const SYNC_ON_REQUEST: Self = Self(252);
    /// Sampled and sent on a remote frame.
    pub const ON_REQUEST: Self = Self(253);
    /// Event-driven, by an event of the manufacturer.
    pub const EVENT_OF_MANUFACTURER: Self = Self(254);
    /// Event-driven, by an event of the device profile.
    pub const EVENT_OF_PROFILE: Self = Self(255);

    /// Returns whether the PDO is event-driven.
    pub const fn is_event_driven(self) -> bool {
        matches!(self, Self::EVENT_OF_MANUFACTURER | Self::EVENT_OF_PROFILE)
    }

    /// Returns whether the content is sampled, or acts, at a SYNC.
    pub const fn is_synchronous(self) -> bool {
        matches!(self, Self(0..=240) | Self::SYNC_ON_REQUEST)
    }

    /// Minimum number of SYNCs between two frames, at least 1; `None` for types without SYNC.
    pub const fn syncs(self) -> Option<u8> {
        match self.0 {
            0 => Some(1),
            1..=240 => Some(self.0),
            _ => None,
        }
    }
}

/// `every SYNC`, `every 4. SYNC`, `on change, at SYNC`, `on event`.
impl fmt::Display for TransmissionType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.write_str("on change, at SYNC"),
            1 => f.write_str("every SYNC"),
            2..=240 => write!(f, "every {}. SYNC", self.0),
            241..=251 => write!(f, "reserved type {}", self.0),
            252..=253 => f.write_str("on remote request"),
            254..=255 => f.write_str("on event"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoded_syncs_decode_to_themselves() {
        for sync in [Sync::default(), Sync { counter: Some(240) }] {
            assert_eq!(Sync::decode(&sync.frame()), Some(sync));
        }
        assert_eq!(Sync::default().frame(), Frame::new(0x80, []));
    }

    #[test]
    fn emergency_is_no_sync() {
        assert_eq!(Sync::decode(&Frame::new(0x81, [])), None);
        assert_eq!(Sync::decode(&Frame::new(0x80, [0; 8])), None);
    }

    #[test]
    fn types_0_to_240_are_synchronous() {
        for kind in 0..=u8::MAX {
            assert_eq!(TransmissionType(kind).syncs().is_some(), kind <= 240);
        }
    }

    #[test]
    fn counter_starts_at_one_and_wraps() {
        let mut counter = Counter::new(Some(3));
        let counted: Vec<_> = (0..5).map(|_| counter.next().frame().to_string()).collect();
        assert_eq!(counted, ["080#01", "080#02", "080#03", "080#01", "080#02"]);
        counter.restart();
        assert_eq!(counter.next().counter, Some(1));
        assert_eq!(Counter::default().next().frame().to_string(), "080#");
    }
}
