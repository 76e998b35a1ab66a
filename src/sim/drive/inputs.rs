//! The terminals of a drive: its digital inputs (60FDh) and safe torque off.
//!
//! Only their levels. What a homing makes of a switch is its mode's business.

/// Levels at the terminals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Inputs {
    /// Bit 0 negative limit switch, 1 positive limit switch, 2 home switch, 16 to 31 the maker's own.
    pub(super) levels: u32,
    /// Safe torque off is asked for: nothing reaches the motor.
    pub(super) is_torque_off: bool,
}

impl Inputs {
    /// What 60FDh holds; safe torque off is its interlock (bit 3).
    pub(super) const fn word(self) -> u32 {
        let interlock = if self.is_torque_off { INTERLOCK } else { 0 };
        self.levels & !INTERLOCK | interlock
    }
}

/// Bit 3 of 60FDh.
const INTERLOCK: u32 = 1 << 3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interlock_is_safe_torque_off_and_no_terminal() {
        for is_torque_off in [false, true] {
            let inputs = Inputs { levels: 0x0001_000F, is_torque_off };
            let word = if is_torque_off { 0x0001_000F } else { 0x0001_0007 };
            assert_eq!(inputs.word(), word);
        }
    }
}
