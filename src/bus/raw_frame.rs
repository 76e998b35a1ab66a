//! `struct can_frame` of linux/can.h, 16 bytes as the kernel hands them over, and what it means to a CANopen
//! node. Any bytes may come: what is no frame for such a node is `None`, never a panic.
//!
//! ```text
//!  0      3  4       5         8                15
//! ┌────────┬────────┬─────────┬──────────────────┐
//! │ can_id │ length │ padding │ data             │   identifier, or the classes of an error
//! └────────┴────────┴─────────┴──────────────────┘
//! ```
//!
//! In an error frame (linux/can/error.h) data byte 1 is what the controller reports, bytes 6 and 7 are its
//! transmit and receive error counters.

use socketcan::id::CAN_EFF_FLAG;
use socketcan::id::CAN_ERR_FLAG;
use socketcan::id::CAN_RTR_FLAG;
use socketcan::id::CAN_SFF_MASK;

use crate::BusEvent;
use crate::BusFault;
use canopen::frame::Frame;

/// Bytes of a classical frame, `CAN_MTU`.
pub(super) const SIZE: usize = 16;

/// Classes of an error, in the identifier.
mod class {
    /// A frame did not get out in time.
    pub(super) const TRANSMIT_TIMEOUT: u32 = 0x001;
    /// See data byte 1.
    pub(super) const CONTROLLER: u32 = 0x004;
    /// The controller has left the bus.
    pub(super) const BUS_OFF: u32 = 0x040;
    /// It had left it, and is back by itself.
    pub(super) const RESTARTED: u32 = 0x100;
    /// Data bytes 6 and 7 hold the error counters.
    pub(super) const COUNTERS: u32 = 0x200;
}

/// What the controller reports, in data byte 1.
mod controller {
    /// Frames lost before they were read, or before they were sent.
    pub(super) const OVERFLOW: u8 = 0x03;
    /// The receive or the transmit error counter has reached [`WARNING`](super::WARNING).
    pub(super) const WARNING: u8 = 0x0C;
    /// One of them has reached [`PASSIVE`](super::PASSIVE).
    pub(super) const PASSIVE: u8 = 0x30;
}

/// An error counter at which a controller warns (ISO 11898-1).
const WARNING: u8 = 96;

/// An error counter from which it is error passive.
const PASSIVE: u8 = 128;

/// What these bytes mean; `None` if they do not concern a CANopen node.
pub(super) fn read(bytes: &[u8]) -> Option<BusEvent> {
    let &[i0, i1, i2, i3, length, _, _, _, ref data @ ..] = bytes else { return None };
    let data: [u8; 8] = data.try_into().ok()?;
    let id = u32::from_ne_bytes([i0, i1, i2, i3]);
    if id & CAN_ERR_FLAG != 0 {
        return fault(id, data).map(BusEvent::Fault);
    }
    if id & CAN_EFF_FLAG != 0 || length > 8 {
        return None;
    }
    let cob_id = u16::try_from(id & CAN_SFF_MASK).ok()?;
    if id & CAN_RTR_FLAG != 0 {
        return Some(BusEvent::Frame(Frame::remote(cob_id, length)));
    }
    let data = data.get(..usize::from(length))?;
    Frame::from_slice(cob_id, data).map(BusEvent::Frame)
}

/// The worst of what an error frame says. Single errors are the controller's to count.
fn fault(classes: u32, [_, reported, _, _, _, _, transmit, receive]: [u8; 8]) -> Option<BusFault> {
    let has = |class: u32| classes & class != 0;
    let reports = |problem: u8| has(class::CONTROLLER) && reported & problem != 0;
    let counts = |least: u8| has(class::COUNTERS) && transmit.max(receive) >= least;
    if has(class::BUS_OFF | class::RESTARTED) {
        Some(BusFault::Off)
    } else if has(class::TRANSMIT_TIMEOUT) || reports(controller::PASSIVE) || counts(PASSIVE) {
        Some(BusFault::Passive)
    } else if reports(controller::OVERFLOW) {
        Some(BusFault::Overrun)
    } else if reports(controller::WARNING) || counts(WARNING) {
        Some(BusFault::Warning)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bytes(id: u32, length: u8, data: [u8; 8]) -> [u8; SIZE] {
        let mut bytes = [0; SIZE];
        bytes[..4].copy_from_slice(&id.to_ne_bytes());
        bytes[4] = length;
        bytes[8..].copy_from_slice(&data);
        bytes
    }

    fn error(classes: u32, data: [u8; 8]) -> Option<BusEvent> {
        read(&bytes(CAN_ERR_FLAG | classes, 8, data))
    }

    #[test]
    fn a_data_frame_is_its_identifier_and_as_many_bytes_as_it_says() {
        let frame = Frame::new(0x181, [1, 2, 3]);
        let received = read(&bytes(0x181, 3, [1, 2, 3, 4, 5, 6, 7, 8]));
        assert_eq!(received, Some(BusEvent::Frame(frame)));
    }

    #[test]
    fn hazard_26_what_is_no_frame_of_eleven_bits_is_not_heard() {
        for (id, length) in [(CAN_EFF_FLAG | 0x181, 8), (0x181, 9), (0x181, 64), (CAN_EFF_FLAG, 0)]
        {
            assert_eq!(read(&bytes(id, length, [0; 8])), None, "{id:X} {length}");
        }
        let remote = read(&bytes(CAN_RTR_FLAG | 0x181, 4, [0; 8]));
        assert_eq!(remote, Some(BusEvent::Frame(Frame::remote(0x181, 4))), "told apart from data");
        assert_eq!(read(&[0; 72]), None, "CAN FD");
    }

    #[test]
    fn hazard_23_an_error_frame_says_how_bad_it_is() {
        let reported = |byte| [0, byte, 0, 0, 0, 0, 0, 0];
        let counted = |transmit, receive| [0, 0, 0, 0, 0, 0, transmit, receive];
        for (classes, data, fault) in [
            (0x040, [0; 8], Some(BusFault::Off)),
            (0x100, [0; 8], Some(BusFault::Off)),
            (0x004, reported(0x10), Some(BusFault::Passive)),
            (0x004, reported(0x20), Some(BusFault::Passive)),
            (0x001, [0; 8], Some(BusFault::Passive)),
            (0x004, reported(0x04), Some(BusFault::Warning)),
            (0x004, reported(0x08), Some(BusFault::Warning)),
            (0x004, reported(0x01), Some(BusFault::Overrun)),
            (0x004, reported(0x02), Some(BusFault::Overrun)),
            (0x004, reported(0x2C), Some(BusFault::Passive)),
            // Back to error active, no acknowledge, a lost arbitration: the controller counts.
            (0x004, reported(0x40), None),
            (0x022, [0; 8], None),
            // Byte 1 belongs to its class, bytes 6 and 7 to theirs.
            (0x020, reported(0x10), None),
            (0x088, counted(255, 255), None),
            (0x200, counted(0, 128), Some(BusFault::Passive)),
            (0x200, counted(128, 0), Some(BusFault::Passive)),
            (0x200, counted(96, 127), Some(BusFault::Warning)),
            (0x200, counted(95, 95), None),
            (0x244, counted(255, 0), Some(BusFault::Off)),
        ] {
            assert_eq!(error(classes, data), fault.map(BusEvent::Fault), "{classes:03X} {data:?}");
        }
    }

    proptest! {
        #[test]
        fn hazard_26_any_bytes_are_a_frame_of_eleven_bits_a_fault_or_nothing(
            bytes in proptest::collection::vec(any::<u8>(), 0..80),
        ) {
            if let Some(BusEvent::Frame(frame)) = read(&bytes) {
                prop_assert_eq!(bytes.len(), SIZE);
                prop_assert!(frame.cob_id < 0x800 && frame.data().len() <= 8);
            }
        }
    }
}
