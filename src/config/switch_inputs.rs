//! Wiring of the switch box: assignment of its input bits (CiA 401, 6000h:1) to the operator's switches.

/// State of the operator's switches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SwitchInputs {
    /// Bit 0: first channel of the deadman, set while it is pressed.
    pub deadman_a: bool,
    /// Bit 1: second channel, antivalent: clear while the deadman is pressed.
    pub deadman_b: bool,
    /// Bit 2: reference (index) button.
    pub reference: bool,
    /// Bit 3: switch of force reflection.
    pub reflection: bool,
    /// Bits 4 to 7: buttons with configurable adjustments, or inputs of a gripper.
    pub buttons: [bool; 4],
}

/// State of the deadman by both channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contacts {
    /// Both channels pressed.
    Pressed,
    /// Both channels released.
    Released,
    /// Channels disagree: normal for a moment while the switch moves, a fault if it lasts.
    Disagreeing,
}

impl SwitchInputs {
    /// Decodes the byte of the switch box (6000h:1).
    pub const fn from_bits(bits: u8) -> Self {
        Self {
            deadman_a: bits & 1 != 0,
            deadman_b: bits & 1 << 1 != 0,
            reference: bits & 1 << 2 != 0,
            reflection: bits & 1 << 3 != 0,
            buttons: [
                bits & 1 << 4 != 0,
                bits & 1 << 5 != 0,
                bits & 1 << 6 != 0,
                bits & 1 << 7 != 0,
            ],
        }
    }

    /// Encodes them as the byte of the switch box (6000h:1).
    pub fn bits(self) -> u8 {
        let Self { deadman_a, deadman_b, reference, reflection, buttons: [b4, b5, b6, b7] } = self;
        let bits = [deadman_a, deadman_b, reference, reflection, b4, b5, b6, b7];
        bits.into_iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(bit))
    }

    /// Returns the state of the deadman by both channels.
    pub const fn deadman(&self) -> Contacts {
        match (self.deadman_a, self.deadman_b) {
            (true, false) => Contacts::Pressed,
            (false, true) => Contacts::Released,
            (false, false) | (true, true) => Contacts::Disagreeing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_written_are_bits_read() {
        for bits in 0..=u8::MAX {
            assert_eq!(SwitchInputs::from_bits(bits).bits(), bits);
        }
    }

    #[test]
    fn broken_wire_never_reads_as_a_pressed_deadman() {
        for bits in 0..=u8::MAX {
            let inputs = SwitchInputs::from_bits(bits);
            assert_eq!(inputs.deadman() == Contacts::Pressed, bits & 3 == 1);
            assert_eq!(inputs.deadman() == Contacts::Released, bits & 3 == 2);
        }
    }
}
