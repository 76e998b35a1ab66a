//! Units and range of positions that a drive stores: 60A8h, 60A9h, 607Bh, and the factors 6093h and 6094h of older
//! dictionaries.
//!
//! | object | expected                                                               |
//! |--------|------------------------------------------------------------------------|
//! | 60A8h  | position unit of the plan: increments                                  |
//! | 60A9h  | revolutions per minute, where the plan writes 6080h                    |
//! | 6093h  | one to one, as a ratio; unset with a zero                              |
//! | 6094h  | one to one, as a ratio; unset with a zero                              |
//! | 607Bh  | the range of the joint, or more; unset with two zeros                  |
//!
//! An SI unit has, from its highest byte, exponent of ten, numerator, denominator and zero (CiA 303-2, CiA 402-2).

use std::f64::consts::TAU;
use std::fmt;

use crate::object::Object;
use units::math;

/// SI unit of an object: exponent of ten, numerator, denominator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SiUnit(pub u32);

impl SiUnit {
    /// Encoder increments: default of 60A8h.
    pub const INCREMENTS: Self = Self(0x00B5_0000);
    /// Revolutions per minute: default of 60A9h.
    pub const RPM: Self = Self(0x00B4_4700);

    /// Returns the number of units per revolution; `None` for increments and all other units that are not angles.
    pub fn per_revolution(self) -> Option<f64> {
        let [exponent, numerator, 0, 0] = self.0.to_be_bytes() else { return None };
        let angle = match numerator {
            RADIAN => TAU,
            DEGREE => 360.0,
            REVOLUTION => 1.0,
            _ => return None,
        };
        Some(angle / power_of_ten(exponent))
    }

    /// Returns the unit in revolutions per minute; `None` for anything but revolutions per time.
    pub fn rpm(self) -> Option<f64> {
        let [exponent, numerator, denominator, _] = self.0.to_be_bytes();
        let time = match (numerator, denominator) {
            (REVOLUTION, MINUTE) => 1.0,
            (REVOLUTION, SECOND) => 60.0,
            _ => return None,
        };
        Some(time * power_of_ten(exponent))
    }
}

fn power_of_ten(exponent: u8) -> f64 {
    math::powf(10.0, exponent.cast_signed().into())
}

/// `FF410000h (10^-1 °)`; the number alone for other units.
impl fmt::Display for SiUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [exponent, numerator, denominator, _] = self.0.to_be_bytes();
        write!(f, "{:08X}h", self.0)?;
        let name = match (numerator, denominator) {
            (INCREMENT, 0) => "increments",
            (RADIAN, 0) => "rad",
            (DEGREE, 0) => "°",
            (REVOLUTION, 0) => "revolutions",
            (REVOLUTION, MINUTE) => "rpm",
            (REVOLUTION, SECOND) => "revolutions/s",
            _ => return Ok(()),
        };
        match exponent.cast_signed() {
            0 => write!(f, " ({name})"),
            exponent => write!(f, " (10^{exponent} {name})"),
        }
    }
}

const SECOND: u8 = 0x03;
const RADIAN: u8 = 0x10;
const DEGREE: u8 = 0x41;
const MINUTE: u8 = 0x47;
const REVOLUTION: u8 = 0xB4;
const INCREMENT: u8 = 0xB5;

/// Returns whether an object is a factor of older dictionaries, which CiA 402-2 has replaced by 608Fh to 6092h.
pub const fn is_outdated(object: Object) -> bool {
    object.index == Object::POSITION_FACTOR.index || object.index == Object::VELOCITY_FACTOR.index
}

/// Expected velocity unit and range.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Units {
    /// Velocity unit (60A9h); `None` if the plan writes no velocity.
    pub velocity: Option<SiUnit>,
    /// Range of the joint in counts of 6064h, which 607Bh must contain; `None` compares no range.
    pub range: Option<[i32; 2]>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_angles_and_speeds() {
        assert_eq!(SiUnit(0xFF41_0000).per_revolution(), Some(3_600.0));
        assert_eq!(SiUnit(0x00B4_0000).per_revolution(), Some(1.0));
        assert_eq!(SiUnit::INCREMENTS.per_revolution(), None);
        for unit in [0xFF41_0300, 0xFF41_0001] {
            assert_eq!(SiUnit(unit).per_revolution(), None, "{unit:X}h is a speed, or unknown");
        }
        assert_eq!((SiUnit::RPM.rpm(), SiUnit(0x00B4_0300).rpm()), (Some(1.0), Some(60.0)));
        assert_eq!(SiUnit(0x00B5_0300).rpm(), None);
        assert_eq!(SiUnit(0x1234_5600).to_string(), "12345600h");
    }
}
