//! SYNC, and what a transmission type makes of it (CiA 301, 7.2.5 and 7.5.2.38).
//!
//! Only the frame: *when* it goes out is the cycle's business. A synchronous TPDO is sampled and sent
//! at the SYNC; a synchronous RPDO acts at the *next* one.

use std::fmt;

use crate::frame::Frame;

/// The COB-ID of the predefined connection set.
pub const COB_ID: u16 = 0x80;

/// One SYNC, which may carry a counter of 1 to 240 (1019h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sync {
    /// The place of this SYNC in the count, if they are counted.
    pub counter: Option<u8>,
}

impl Sync {
    /// Reads a SYNC, `None` if the frame is none.
    pub fn decode(frame: &Frame) -> Option<Self> {
        match (frame.cob_id, frame.data()) {
            (COB_ID, []) => Some(Self { counter: None }),
            (COB_ID, [counter]) => Some(Self { counter: Some(*counter) }),
            _ => None,
        }
    }

    /// The frame that says it.
    pub fn frame(self) -> Frame {
        match self.counter {
            None => Frame::new(COB_ID, []),
            Some(counter) => Frame::new(COB_ID, [counter]),
        }
    }
}

/// Counts SYNCs from 1 to their synchronous counter overflow value (1019h), and again from 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counter {
    overflow: Option<u8>,
    last: u8,
}

impl Counter {
    /// Up to `overflow`, 2 to 240; `None` counts nothing.
    pub const fn new(overflow: Option<u8>) -> Self {
        Self { overflow, last: 0 }
    }

    /// The next SYNC.
    pub const fn next(&mut self) -> Sync {
        let Some(overflow) = self.overflow else { return Sync { counter: None } };
        self.last = if self.last >= overflow { 1 } else { self.last + 1 };
        Sync { counter: Some(self.last) }
    }

    /// Begins again at 1, as whenever the network is started.
    pub const fn restart(&mut self) {
        self.last = 0;
    }
}

/// When a PDO is sent, or acts: sub-index 2 of its communication parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Transmission(pub u8);

impl Transmission {
    /// At the SYNC after a change.
    pub const SYNC_ON_CHANGE: Self = Self(0);
    /// At every SYNC.
    pub const EVERY_SYNC: Self = Self(1);
    /// Sampled at every SYNC, sent when a remote frame asks for it.
    pub const SYNC_ON_REQUEST: Self = Self(252);
    /// Sampled and sent when a remote frame asks for it.
    pub const ON_REQUEST: Self = Self(253);
    /// At once, on an event the manufacturer defines.
    pub const EVENT_OF_MANUFACTURER: Self = Self(254);
    /// At once, on an event the device profile defines.
    pub const EVENT_OF_PROFILE: Self = Self(255);

    /// Whether events alone govern it.
    pub const fn is_event_driven(self) -> bool {
        matches!(self, Self::EVENT_OF_MANUFACTURER | Self::EVENT_OF_PROFILE)
    }

    /// Whether its content is of a SYNC.
    pub const fn is_synchronous(self) -> bool {
        matches!(self, Self(0..=240) | Self::SYNC_ON_REQUEST)
    }

    /// The fewest SYNCs between two frames, at least 1; `None` if no SYNC governs them.
    pub const fn syncs(self) -> Option<u8> {
        match self.0 {
            0 => Some(1),
            1..=240 => Some(self.0),
            _ => None,
        }
    }
}

/// `every SYNC`, `every 4. SYNC`, `on change, at SYNC`, `on event`.
impl fmt::Display for Transmission {
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
    fn what_is_sent_is_what_is_read() {
        for sync in [Sync::default(), Sync { counter: Some(240) }] {
            assert_eq!(Sync::decode(&sync.frame()), Some(sync));
        }
        assert_eq!(Sync::default().frame(), Frame::new(0x80, []));
    }

    #[test]
    fn an_emergency_is_no_sync() {
        assert_eq!(Sync::decode(&Frame::new(0x81, [])), None);
        assert_eq!(Sync::decode(&Frame::new(0x80, [0; 8])), None);
    }

    #[test]
    fn sync_governs_types_0_to_240() {
        for kind in 0..=u8::MAX {
            assert_eq!(Transmission(kind).syncs().is_some(), kind <= 240);
        }
    }

    #[test]
    fn counted_syncs_begin_at_one_and_go_round() {
        let mut counter = Counter::new(Some(3));
        let counted: Vec<_> = (0..5).map(|_| counter.next().frame().to_string()).collect();
        assert_eq!(counted, ["080#01", "080#02", "080#03", "080#01", "080#02"]);
        counter.restart();
        assert_eq!(counter.next().counter, Some(1));
        assert_eq!(Counter::default().next().frame().to_string(), "080#");
    }
}
