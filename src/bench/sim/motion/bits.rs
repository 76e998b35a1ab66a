//! Mode-specific bits of controlword and statusword (CiA 402-2, 10 to 15).

use canopen::drive::Controlword;

/// Statusword bit 10: target reached; while halted, standstill.
pub(super) const TARGET_REACHED: u16 = 1 << 10;
/// Statusword bit 12 in profile position mode: set-point acknowledged.
pub(super) const SET_POINT_ACKNOWLEDGED: u16 = 1 << 12;
/// Statusword bit 12 in profile velocity mode: speed zero.
pub(super) const SPEED_ZERO: u16 = 1 << 12;
/// Statusword bit 12 in homing mode: homing attained.
pub(super) const HOMING_ATTAINED: u16 = 1 << 12;
/// Statusword bit 13 in position modes: following error.
pub(super) const FOLLOWING_ERROR: u16 = 1 << 13;
/// Statusword bit 13 in homing mode: homing error.
pub(super) const HOMING_ERROR: u16 = 1 << 13;

/// Controlword bit 4: new set-point, or start of homing.
pub(super) const fn is_started(word: Controlword) -> bool {
    word.0 & 1 << 4 != 0
}

/// Controlword bit 5: change set immediately.
pub(super) const fn is_immediate(word: Controlword) -> bool {
    word.0 & 1 << 5 != 0
}

/// Controlword bit 6: the target is relative.
pub(super) const fn is_relative(word: Controlword) -> bool {
    word.0 & 1 << 6 != 0
}

/// Controlword bit 8: halt with the option of 605Dh; the drive stays enabled.
pub(super) const fn is_halted(word: Controlword) -> bool {
    word.0 & 1 << 8 != 0
}

/// Returns `bit` if `is_set`, else 0.
pub(super) const fn bit(bit: u16, is_set: bool) -> u16 {
    if is_set { bit } else { 0 }
}
