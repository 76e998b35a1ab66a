//! One object of a plan: its value, and what follows if a node has no such object or refuses the value.
//!
//! The proof test at power-up measures whether a drive stops; option codes conclude nothing. Objects that
//! CiA 301 and CiA 402-2 make optional are therefore means: written where a drive has them, not demanded.

use canopen_rs::Value;

use crate::master::check::Check;
use crate::object::Object;

/// Value of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Object, value to write, and comparison at the read-back.
    pub check: Check,
    /// Consequence of its absence.
    pub need: Need,
}

/// Consequence of a node without an object, or one that refuses its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Need {
    /// The boot fails.
    Must,
    /// A node without the object passes.
    IfPresent,
    /// A node without the object passes, and so does one that refuses the value: the proof test shows what it does.
    IfAccepted,
}

/// Optional objects whose value a drive may refuse.
const MEANS: [Object; 10] = [
    Object::CYCLE_PERIOD,
    Object::ERROR_BEHAVIOUR,
    Object::ABORT_CONNECTION,
    Object::QUICK_STOP_OPTION,
    Object::SHUTDOWN_OPTION,
    Object::DISABLE_OPERATION_OPTION,
    Object::HALT_OPTION,
    Object::FAULT_REACTION,
    Object::INTERPOLATION_TIME,
    Object::INTERPOLATION_TIME_INDEX,
];

/// Returns why no write of a configuration may precede the plan at an object; `None` if one may.
pub const fn reserved(object: Object) -> Option<&'static str> {
    match object.index {
        0x1010 | 0x1011 => {
            Some("stores and restores parameters: see node.store_configuration and frhc sdo")
        }
        0x1400..=0x1BFF => Some("is a PDO parameter, which the layout sets"),
        0x1F50..=0x1F5F => Some("is for programs of the device, which no boot changes"),
        0x1005
        | 0x1006
        | 0x100C
        | 0x100D
        | 0x1014..=0x1017
        | 0x1019
        | 0x1029
        | 0x6007
        | 0x605A..=0x605E
        | 0x6040
        | 0x6060
        | 0x6071
        | 0x6072
        | 0x6080
        | 0x60C2 => Some("is written by the plan, whose value follows from other keys"),
        _ => None,
    }
}

impl Need {
    /// Returns how much depends on a reaction or limit of a drive.
    pub fn of(object: Object) -> Self {
        match object {
            _ if MEANS.contains(&object) => Self::IfAccepted,
            Object::MAX_MOTOR_SPEED => Self::IfPresent,
            _ => Self::Must,
        }
    }

    /// Returns whether the boot fails without the object.
    pub const fn is_must(self) -> bool {
        matches!(self, Self::Must)
    }
}

impl Setting {
    /// Returns whether the boot fails if a drive keeps to limits that exclude the value. Data sheets limit 1016h to the
    /// time alone, forgetting the node-id above it: the boot shows what the drive does.
    pub fn fails_beyond_limits(&self) -> bool {
        self.need.is_must() && self.check.object != Object::CONSUMER_HEARTBEAT
    }

    /// Returns a setting without which the boot fails.
    pub const fn must(object: Object, value: Value) -> Self {
        Self { check: Check::exactly(object, value), need: Need::Must }
    }
}

/// Interpolation time period (60C2h) of a SYNC period: the most significant whole number of 10ⁿ s that fits one byte,
/// and n. `None` for a period that is no such number.
pub fn interpolation_time(period_us: u64) -> Option<(u8, i8)> {
    [(1_000_u64, -3_i8), (100, -4), (10, -5), (1, -6)].into_iter().find_map(|(unit, index)| {
        let count = u8::try_from(period_us / unit).ok()?;
        (count > 0 && period_us.is_multiple_of(unit)).then_some((count, index))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_of_the_plan_are_reserved() {
        let of = |index| reserved(Object { index, sub: 0 });
        for index in [0x1005, 0x1016, 0x1400, 0x1A03, 0x605A, 0x6071, 0x6072, 0x1010, 0x1F51] {
            assert!(of(index).is_some(), "{index:04X}h");
        }
        for index in [0x2182, 0x6065, 0x607E, 0x6076, 0x6091, 0x60C5] {
            assert_eq!(of(index), None, "{index:04X}h");
        }
    }

    #[test]
    fn option_codes_are_means_and_limits_are_not() {
        assert_eq!(Need::of(Object::FAULT_REACTION), Need::IfAccepted);
        assert_eq!(Need::of(Object::MAX_MOTOR_SPEED), Need::IfPresent);
        for object in [Object::MAX_TORQUE, Object::CONSUMER_HEARTBEAT, Object::LIFE_TIME_FACTOR] {
            assert!(Need::of(object).is_must(), "{object}");
        }
    }

    #[test]
    fn interpolation_time_is_the_period_in_powers_of_ten() {
        assert_eq!(interpolation_time(1_000), Some((1, -3)));
        assert_eq!(interpolation_time(2_000), Some((2, -3)));
        assert_eq!(interpolation_time(500), Some((5, -4)));
        assert_eq!(interpolation_time(1_250), Some((125, -5)));
        assert_eq!(interpolation_time(100_000), Some((100, -3)));
        assert_eq!(interpolation_time(1_251), None, "1251 × 1 µs does not fit one byte");
    }
}
