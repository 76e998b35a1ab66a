//! The bits of controlword and statusword that each mode has its own meaning for (CiA 402-2, 10 to 15).

use canopen::drive::Controlword;

/// Statusword, bit 10: the target is reached; while halted, the motor stands still.
pub(super) const TARGET_REACHED: u16 = 1 << 10;
/// Statusword, bit 12 in profile position mode: the set-point is taken.
pub(super) const SET_POINT_ACKNOWLEDGED: u16 = 1 << 12;
/// Statusword, bit 12 in profile velocity mode: the motor stands still.
pub(super) const SPEED_ZERO: u16 = 1 << 12;
/// Statusword, bit 12 in homing mode: the home position is known.
pub(super) const HOMING_ATTAINED: u16 = 1 << 12;
/// Statusword, bit 13 in position modes: too far behind, for too long.
pub(super) const FOLLOWING_ERROR: u16 = 1 << 13;
/// Statusword, bit 13 in homing mode.
pub(super) const HOMING_ERROR: u16 = 1 << 13;

/// Bit 4: a new set-point, or the start of homing.
pub(super) const fn is_started(word: Controlword) -> bool {
    word.0 & 1 << 4 != 0
}

/// Bit 5: the set-point takes the place of the one before at once.
pub(super) const fn is_immediate(word: Controlword) -> bool {
    word.0 & 1 << 5 != 0
}

/// Bit 6: the set-point counts from the one before.
pub(super) const fn is_relative(word: Controlword) -> bool {
    word.0 & 1 << 6 != 0
}

/// Bit 8: stop as 605Dh says, and stay enabled.
pub(super) const fn is_halted(word: Controlword) -> bool {
    word.0 & 1 << 8 != 0
}

/// `bit` if it `is_set`.
pub(super) const fn bit(bit: u16, is_set: bool) -> u16 {
    if is_set { bit } else { 0 }
}
