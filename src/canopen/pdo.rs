//! The bytes of the cyclic PDOs, in the `per-drive` layout: read and written side by side.
//!
//! Not how a node is told to send them: that is [`layout`](crate::canopen::layout), and a test holds
//! the two together. Fixed places, no object dictionary: this runs every cycle.
//!
//! | frame              | bytes                                                                |
//! |--------------------|----------------------------------------------------------------------|
//! | TPDO1 of a drive   | 0–1 statusword 6041h, 2–5 position 6064h, 6–7 torque 6077h           |
//! | RPDO1 of a drive   | 0–1 controlword 6040h, 2–3 target torque 6071h                       |
//! | TPDO1 of the switch box | 0 digital inputs 6000h:1                                        |

use thiserror::Error;

use crate::canopen::drive::Controlword;
use crate::canopen::drive::Statusword;

/// A position of an encoder, in its counts; wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Counts(pub i32);

/// A torque, in thousandths of the motor's rated torque (6076h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PerMille(pub i16);

/// A PDO of another length than its mapping gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a PDO of {found} bytes, expected {expected}")]
pub struct WrongLength {
    /// What the mapping gives.
    pub expected: usize,
    /// What came.
    pub found: usize,
}

/// What a drive sampled at the SYNC: its TPDO1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveSample {
    /// Its state.
    pub statusword: Statusword,
    /// Where its encoder is.
    pub position: Counts,
    /// The torque it exerts.
    pub torque: PerMille,
}

impl DriveSample {
    /// Reads a TPDO1.
    ///
    /// # Errors
    /// When it is not eight bytes long.
    pub const fn decode(data: &[u8]) -> Result<Self, WrongLength> {
        let &[s0, s1, p0, p1, p2, p3, t0, t1] = data else {
            return Err(WrongLength { expected: 8, found: data.len() });
        };
        Ok(Self {
            statusword: Statusword(u16::from_le_bytes([s0, s1])),
            position: Counts(i32::from_le_bytes([p0, p1, p2, p3])),
            torque: PerMille(i16::from_le_bytes([t0, t1])),
        })
    }

    /// The bytes of a TPDO1.
    pub const fn encode(&self) -> [u8; 8] {
        let [s0, s1] = self.statusword.0.to_le_bytes();
        let [p0, p1, p2, p3] = self.position.0.to_le_bytes();
        let [t0, t1] = self.torque.0.to_le_bytes();
        [s0, s1, p0, p1, p2, p3, t0, t1]
    }
}

/// What a drive is to do from the next SYNC on: its RPDO1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveTarget {
    /// Where its power stage is led.
    pub controlword: Controlword,
    /// The torque it is to exert.
    pub torque: PerMille,
}

impl DriveTarget {
    /// Reads an RPDO1.
    ///
    /// # Errors
    /// When it is not four bytes long.
    pub const fn decode(data: &[u8]) -> Result<Self, WrongLength> {
        let &[c0, c1, t0, t1] = data else {
            return Err(WrongLength { expected: 4, found: data.len() });
        };
        Ok(Self {
            controlword: Controlword(u16::from_le_bytes([c0, c1])),
            torque: PerMille(i16::from_le_bytes([t0, t1])),
        })
    }

    /// The bytes of an RPDO1.
    pub const fn encode(&self) -> [u8; 4] {
        let [c0, c1] = self.controlword.0.to_le_bytes();
        let [t0, t1] = self.torque.0.to_le_bytes();
        [c0, c1, t0, t1]
    }
}

/// The operator's switches: TPDO1 of the switch box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SwitchInputs {
    /// Bit 0: first channel of the deadman, set while it is pressed.
    pub deadman_a: bool,
    /// Bit 1: second channel, antivalent: *clear* while it is pressed.
    pub deadman_b: bool,
    /// Bit 2: the reference (index) button.
    pub reference: bool,
    /// Bit 3: reflection of forces is wanted.
    pub reflection: bool,
}

/// What the two channels of the deadman say together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deadman {
    /// Both say pressed.
    Pressed,
    /// Both say released.
    Released,
    /// They disagree: moving for a moment, broken if it lasts.
    Disagreeing,
}

impl SwitchInputs {
    /// Reads a TPDO1; bits 4 to 7 are not connected.
    ///
    /// # Errors
    /// When it is not one byte long.
    pub const fn decode(data: &[u8]) -> Result<Self, WrongLength> {
        let &[bits] = data else {
            return Err(WrongLength { expected: 1, found: data.len() });
        };
        Ok(Self {
            deadman_a: bits & 1 != 0,
            deadman_b: bits & 1 << 1 != 0,
            reference: bits & 1 << 2 != 0,
            reflection: bits & 1 << 3 != 0,
        })
    }

    /// The byte of a TPDO1.
    pub fn encode(&self) -> [u8; 1] {
        [u8::from(self.deadman_a)
            | u8::from(self.deadman_b) << 1
            | u8::from(self.reference) << 2
            | u8::from(self.reflection) << 3]
    }

    /// Whether the deadman is pressed, by both its channels.
    pub const fn deadman(&self) -> Deadman {
        match (self.deadman_a, self.deadman_b) {
            (true, false) => Deadman::Pressed,
            (false, true) => Deadman::Released,
            (false, false) | (true, true) => Deadman::Disagreeing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bytes_written_are_bytes_read(
            eight in any::<[u8; 8]>(),
            four in any::<[u8; 4]>(),
            bits in 0_u8..16,
        ) {
            prop_assert_eq!(DriveSample::decode(&eight).unwrap().encode(), eight);
            prop_assert_eq!(DriveTarget::decode(&four).unwrap().encode(), four);
            prop_assert_eq!(SwitchInputs::decode(&[bits]).unwrap().encode(), [bits]);
        }

        #[test]
        fn only_the_mapped_length_is_read(data in proptest::collection::vec(any::<u8>(), 0..12)) {
            prop_assert_eq!(DriveSample::decode(&data).is_ok(), data.len() == 8);
            prop_assert_eq!(DriveTarget::decode(&data).is_ok(), data.len() == 4);
            prop_assert_eq!(SwitchInputs::decode(&data).is_ok(), data.len() == 1);
        }
    }

    #[test]
    fn numbers_are_little_endian_and_signed() {
        let sample =
            DriveSample::decode(&[0x37, 0x16, 0xFE, 0xFF, 0xFF, 0xFF, 0x18, 0xFC]).unwrap();
        let read = (sample.statusword, sample.position, sample.torque);
        assert_eq!(read, (Statusword(0x1637), Counts(-2), PerMille(-1_000)));
        let target =
            DriveTarget { controlword: Controlword::ENABLE_OPERATION, torque: PerMille(-2) };
        assert_eq!(target.encode(), [0x0F, 0x00, 0xFE, 0xFF]);
    }

    #[test]
    fn a_broken_wire_never_reads_as_a_pressed_deadman() {
        for bits in 0..16 {
            let inputs = SwitchInputs::decode(&[bits]).unwrap();
            assert_eq!(inputs.deadman() == Deadman::Pressed, bits & 3 == 1);
            assert_eq!(inputs.deadman() == Deadman::Released, bits & 3 == 2);
        }
    }
}
