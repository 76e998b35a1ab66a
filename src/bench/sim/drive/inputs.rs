//! Digital inputs of a drive (60FDh) and safe torque off. Levels only: homing evaluates the switches.

/// Levels of the inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Inputs {
    /// Bit 0 negative limit switch, 1 positive limit switch, 2 home switch, 16 to 31 manufacturer-specific.
    pub(super) levels: u32,
    /// Safe torque off is active.
    pub(super) is_torque_off: bool,
}

impl Inputs {
    /// Returns the value of 60FDh; safe torque off is the interlock (bit 3).
    pub(super) const fn word(self) -> u32 {
        let interlock = if self.is_torque_off { INTERLOCK } else { 0 };
        self.levels & !INTERLOCK | interlock
    }
}

/// Interlock, bit 3 of 60FDh.
const INTERLOCK: u32 = 1 << 3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interlock_bit_shows_safe_torque_off() {
        for is_torque_off in [false, true] {
            let inputs = Inputs { levels: 0x0001_000F, is_torque_off };
            let word = if is_torque_off { 0x0001_000F } else { 0x0001_0007 };
            assert_eq!(inputs.word(), word);
        }
    }
}
