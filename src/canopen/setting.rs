//! Setting of one object in a plan: its value, and the consequence if a node lacks the object or refuses the value.
//!
//! The proof test at power-up measures whether a drive stops; option codes prove nothing. Objects that CiA 301 and
//! CiA 402-2 make optional are therefore means: they are written if present, but not required.

use canopen_rs::Value;

use crate::master::check::Check;
use crate::object::Object;

/// Value of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Object, value to write, and comparison at the read-back.
    pub check: Check,
    /// Consequence if a node lacks the object.
    pub need: Need,
}

/// Consequence of a node without an object, or one that refuses its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Need {
    /// Mandatory object: the boot fails.
    Must,
    /// Optional object: a node without it passes.
    IfPresent,
    /// Optional object whose value a node may also refuse. The proof test measures the reaction of the node.
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

/// Offsets that a drive adds to its set-points from enabling on (CiA 402-2): zero, as the controller knows of none.
pub(crate) const OFFSETS: [Object; 3] =
    [Object::TORQUE_OFFSET, Object::VELOCITY_OFFSET, Object::POSITION_OFFSET];

/// Returns whether a write of the boot may be repeated without a second effect. Commands (1010h, 1011h) act at every
/// write, and so may manufacturer-specific objects.
pub(crate) const fn may_be_written_twice(object: Object) -> bool {
    let is_command = matches!(object.index, 0x1010 | 0x1011 | 0x1F50..=0x1F5F);
    !is_command && !object.is_of_maker()
}

/// Writes that clear the offsets.
pub(crate) const fn no_offsets() -> [(Object, Value); 3] {
    [
        (Object::TORQUE_OFFSET, Value::Integer16(0)),
        (Object::VELOCITY_OFFSET, Value::Integer32(0)),
        (Object::POSITION_OFFSET, Value::Integer32(0)),
    ]
}

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
        0x60B0..=0x60B2 => Some(
            "is written 0 by the plan, as an offset acts from enabling on: leave it out; gravity and friction are keys of \
             [[joint]] and [controller.friction]",
        ),
        0x60E0 | 0x60E1 => Some(
            "is compared with the capacity of the joint, not written: set it with the maker's tool, or limit the joint by \
             max_torque_nm (max_force_n)",
        ),
        _ => None,
    }
}

/// Returns the remedy for a value that a drive keeps, to be appended to the message; empty for most objects.
pub(crate) const fn remedy(object: Object) -> &'static str {
    match object.index {
        0x60B0..=0x60B2 => ": an offset acts from enabling on; clear it with the maker's tool",
        0x6061 => {
            ": if it displays its mode only when enabled, say mode_shown = \"enabled\" in [joint.boot]"
        }
        _ => "",
    }
}

/// Returns whether an object can limit torque inside a drive: 6072h, 6073h, 60E0h, 60E1h, or one of the maker (2000h
/// to 5FFFh). No other object of CiA 301 or CiA 402-2 does: 6087h, for example, is the slope of a profile.
pub fn can_limit_torque(object: Object) -> bool {
    let standard = [
        Object::MAX_TORQUE,
        Object::MAX_CURRENT,
        Object::POSITIVE_TORQUE_LIMIT,
        Object::NEGATIVE_TORQUE_LIMIT,
    ];
    object.is_of_maker() || standard.contains(&object)
}

impl Need {
    /// Returns the need of an object with a reaction or limit of a drive.
    pub fn for_object(object: Object) -> Self {
        match object {
            _ if MEANS.contains(&object) => Self::IfAccepted,
            Object::MAX_MOTOR_SPEED => Self::IfPresent,
            _ if OFFSETS.contains(&object) => Self::IfPresent,
            _ => Self::Must,
        }
    }

    /// Returns whether the boot fails without the object.
    pub const fn is_must(self) -> bool {
        matches!(self, Self::Must)
    }
}

impl Setting {
    /// Returns whether the boot fails if the drive enforces limits that exclude the value. False for 1016h, which many data
    /// sheets limit to its time alone without the node-id; the boot shows whether the drive enforces that.
    pub fn fails_beyond_limits(&self) -> bool {
        self.need.is_must() && self.check.object != Object::CONSUMER_HEARTBEAT
    }

    /// Returns a setting without which the boot fails.
    pub const fn must(object: Object, value: Value) -> Self {
        Self { check: Check::exactly(object, value), need: Need::Must }
    }
}

/// Interpolation time period (60C2h) of a SYNC period: a count of 10ⁿ s that fits one byte, and n, the largest possible.
/// `None` for a period without such a count.
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
        for index in [0x60B0, 0x60B1, 0x60B2] {
            assert!(of(index).unwrap().contains("leave it out"), "{index:04X}h");
        }
        for index in [0x60E0, 0x60E1] {
            assert!(of(index).unwrap().contains("max_torque_nm"), "{index:04X}h");
        }
        for index in [0x2182, 0x6065, 0x607E, 0x6076, 0x6091, 0x60C5] {
            assert_eq!(of(index), None, "{index:04X}h");
        }
    }

    #[test]
    fn only_limits_and_objects_of_the_maker_limit_torque() {
        let can = |index, sub| can_limit_torque(Object { index, sub });
        for (index, sub) in
            [(0x6072, 0), (0x6073, 0), (0x60E0, 0), (0x60E1, 0), (0x2000, 0), (0x5FFF, 9)]
        {
            assert!(can(index, sub), "{index:04X}h:{sub}");
        }
        for (index, sub) in [
            (0x6087, 0),
            (0x6071, 0),
            (0x6075, 0),
            (0x6872, 0),
            (0x1FFF, 0),
            (0x6000, 0),
            (0x9FFF, 0),
            (0x6072, 1),
        ] {
            assert!(!can(index, sub), "{index:04X}h:{sub}");
        }
    }

    #[test]
    fn option_codes_are_means_and_limits_are_not() {
        assert_eq!(Need::for_object(Object::FAULT_REACTION), Need::IfAccepted);
        assert_eq!(Need::for_object(Object::MAX_MOTOR_SPEED), Need::IfPresent);
        assert_eq!(OFFSETS.map(Need::for_object), [Need::IfPresent; 3]);
        for object in [Object::MAX_TORQUE, Object::CONSUMER_HEARTBEAT, Object::LIFE_TIME_FACTOR] {
            assert!(Need::for_object(object).is_must(), "{object}");
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
