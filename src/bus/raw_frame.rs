//! Decodes `struct can_frame` (linux/can.h, 16 bytes). Any bytes are safe: a frame that does not concern a CANopen node
//! gives `None`.
//!
//! ```text
//!  0      3  4       5         8                15
//! ┌────────┬────────┬─────────┬──────────────────┐
//! │ can_id │ length │ padding │ data             │   identifier, or the classes of an error
//! └────────┴────────┴─────────┴──────────────────┘
//! ```
//!
//! In an error frame (linux/can/error.h) data byte 1 is the controller status, bytes 6 and 7 are the transmit and
//! receive error counters.

use socketcan::id::{CAN_EFF_FLAG, CAN_ERR_FLAG, CAN_RTR_FLAG, CAN_SFF_MASK};

use crate::{BusError, BusEvent};
use canopen::frame::Frame;

/// Bytes of a classical frame, `CAN_MTU`.
pub(super) const SIZE: usize = 16;

/// Error classes, in the identifier.
mod class {
    /// No frame could be transmitted within the driver's time.
    pub(super) const TRANSMIT_TIMEOUT: u32 = 0x001;
    /// Controller status, in data byte 1.
    pub(super) const CONTROLLER: u32 = 0x004;
    /// Controller left the bus: its transmit error counter exceeds 255 (ISO 11898-1).
    pub(super) const BUS_OFF: u32 = 0x040;
    /// Controller restarted after bus-off.
    pub(super) const RESTARTED: u32 = 0x100;
    /// Error counters, in data bytes 6 and 7.
    pub(super) const COUNTERS: u32 = 0x200;
}

/// Controller status in data byte 1.
mod controller {
    /// Receive or transmit buffer overflow.
    pub(super) const OVERFLOW: u8 = 0x03;
    /// Error warning: a counter has reached [`WARNING`](super::WARNING).
    pub(super) const WARNING: u8 = 0x0C;
    /// Error passive: a counter has reached [`PASSIVE`](super::PASSIVE).
    pub(super) const PASSIVE: u8 = 0x30;
}

/// Error counter of the warning limit (ISO 11898-1).
const WARNING: u8 = 96;

/// Error counter of the error passive state (ISO 11898-1).
const PASSIVE: u8 = 128;

/// Decodes a frame; `None` if it does not concern a CANopen node.
pub(super) fn read(bytes: &[u8]) -> Option<BusEvent> {
    let &[i0, i1, i2, i3, length, _, _, _, ref data @ ..] = bytes else { return None };
    let data: [u8; 8] = data.try_into().ok()?;
    let id = u32::from_ne_bytes([i0, i1, i2, i3]);
    if id & CAN_ERR_FLAG != 0 {
        return worst(id, data).map(BusEvent::Error);
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

/// Returns the worst error in an error frame. Single errors on the wire are ignored: the controller counts them.
fn worst(classes: u32, [_, reported, _, _, _, _, transmit, receive]: [u8; 8]) -> Option<BusError> {
    let has = |class: u32| classes & class != 0;
    let reports = |problem: u8| has(class::CONTROLLER) && reported & problem != 0;
    let counts = |least: u8| has(class::COUNTERS) && transmit.max(receive) >= least;
    if has(class::BUS_OFF | class::RESTARTED) {
        Some(BusError::Off)
    } else if has(class::TRANSMIT_TIMEOUT) || reports(controller::PASSIVE) || counts(PASSIVE) {
        Some(BusError::Passive)
    } else if reports(controller::OVERFLOW) {
        Some(BusError::Overrun)
    } else if reports(controller::WARNING) || counts(WARNING) {
        Some(BusError::Warning)
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
    fn data_frame_has_identifier_and_length() {
        let frame = Frame::new(0x181, [1, 2, 3]);
        let received = read(&bytes(0x181, 3, [1, 2, 3, 4, 5, 6, 7, 8]));
        assert_eq!(received, Some(BusEvent::Frame(frame)));
    }

    #[test]
    fn hazard_26_frames_without_eleven_bits_are_ignored() {
        for (id, length) in [(CAN_EFF_FLAG | 0x181, 8), (0x181, 9), (0x181, 64), (CAN_EFF_FLAG, 0)]
        {
            assert_eq!(read(&bytes(id, length, [0; 8])), None, "{id:X} {length}");
        }
        let remote = read(&bytes(CAN_RTR_FLAG | 0x181, 4, [0; 8]));
        assert_eq!(remote, Some(BusEvent::Frame(Frame::remote(0x181, 4))), "distinct from data");
        assert_eq!(read(&[0; 72]), None, "CAN FD");
    }

    #[test]
    fn hazard_23_error_frames_give_the_worst_fault() {
        let reported = |byte| [0, byte, 0, 0, 0, 0, 0, 0];
        let counted = |transmit, receive| [0, 0, 0, 0, 0, 0, transmit, receive];
        for (classes, data, worst) in [
            (0x040, [0; 8], Some(BusError::Off)),
            (0x100, [0; 8], Some(BusError::Off)),
            (0x004, reported(0x10), Some(BusError::Passive)),
            (0x004, reported(0x20), Some(BusError::Passive)),
            (0x001, [0; 8], Some(BusError::Passive)),
            (0x004, reported(0x04), Some(BusError::Warning)),
            (0x004, reported(0x08), Some(BusError::Warning)),
            (0x004, reported(0x01), Some(BusError::Overrun)),
            (0x004, reported(0x02), Some(BusError::Overrun)),
            (0x004, reported(0x2C), Some(BusError::Passive)),
            // Error active again, no acknowledge, lost arbitration: no bus error.
            (0x004, reported(0x40), None),
            (0x022, [0; 8], None),
            // Byte 1 and bytes 6 and 7 count only with their classes.
            (0x020, reported(0x10), None),
            (0x088, counted(255, 255), None),
            (0x200, counted(0, 128), Some(BusError::Passive)),
            (0x200, counted(128, 0), Some(BusError::Passive)),
            (0x200, counted(96, 127), Some(BusError::Warning)),
            (0x200, counted(95, 95), None),
            (0x244, counted(255, 0), Some(BusError::Off)),
        ] {
            assert_eq!(error(classes, data), worst.map(BusEvent::Error), "{classes:03X} {data:?}");
        }
    }

    proptest! {
        #[test]
        fn hazard_26_any_bytes_give_an_11_bit_frame_fault_or_nothing(
            bytes in proptest::collection::vec(any::<u8>(), 0..80),
        ) {
            if let Some(BusEvent::Frame(frame)) = read(&bytes) {
                prop_assert_eq!(bytes.len(), SIZE);
                prop_assert!(frame.cob_id < 0x800 && frame.data().len() <= 8);
            }
        }
    }
}
