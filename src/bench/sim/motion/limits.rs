//! Limits that apply to all modes: torque, speed, acceleration, position.

use crate::motion::ramp::Profile;
use crate::motion::units::{Units, signed};
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Torque range, in ‰ of rated torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TorqueLimits {
    low: f64,
    high: f64,
}

impl TorqueLimits {
    /// Reads the minimum of 6072h, 6073h and, per direction, 60E0h and 60E1h. Torque is proportional to current. An
    /// absent object is no limit.
    pub(super) fn from_dictionary(dictionary: &Dictionary) -> Self {
        let limit = |object| dictionary.optional(object).map_or(NO_TORQUE_LIMIT, f64::from);
        let both = limit(Object::MAX_TORQUE).min(limit(Object::MAX_CURRENT));
        Self {
            low: -both.min(limit(Object::NEGATIVE_TORQUE_LIMIT)),
            high: both.min(limit(Object::POSITIVE_TORQUE_LIMIT)),
        }
    }

    /// Returns `wanted` within the range, 0 for NaN.
    pub(super) const fn clamp(&self, wanted: f64) -> LimitedValue {
        if wanted > self.high {
            LimitedValue { value: self.high, is_limited: true }
        } else if wanted < self.low {
            LimitedValue { value: self.low, is_limited: true }
        } else if wanted.is_nan() {
            LimitedValue { value: 0.0, is_limited: true }
        } else {
            LimitedValue { value: wanted, is_limited: false }
        }
    }
}

/// Largest value of a limit, and that of an absent one, in ‰: finite, as a deceleration follows from it.
const NO_TORQUE_LIMIT: f64 = 65_535.0;

/// Value within a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LimitedValue {
    pub(super) value: f64,
    /// Set if the limit has changed the value.
    pub(super) is_limited: bool,
}

/// Returns `wanted` within `-bound..=bound`, 0 for NaN.
pub(super) const fn within(wanted: f64, bound: f64) -> LimitedValue {
    let value = if wanted.is_nan() { 0.0 } else { wanted.min(bound).max(-bound) };
    LimitedValue { value, is_limited: wanted > bound || wanted < -bound }
}

/// Returns the speed limit of 6080h and 607Fh, in increments/s; infinite without either.
pub(super) fn top_speed(units: &Units, dictionary: &Dictionary) -> f64 {
    let motor = dictionary.optional(Object::MAX_MOTOR_SPEED);
    let motor = motor.map_or(f64::INFINITY, |speed| units.motor_speed(f64::from(speed)));
    motor.min(units.limit(dictionary, Object::MAX_PROFILE_VELOCITY))
}

/// Reads 6081h, 6083h and 6084h, within [`top_speed`], 60C5h and 60C6h.
pub(super) fn profile(units: &Units, dictionary: &Dictionary) -> Profile {
    let wanted = units.size(dictionary, Object::PROFILE_VELOCITY);
    Profile::new(
        wanted.min(top_speed(units, dictionary)),
        acceleration(units, dictionary, Object::PROFILE_ACCELERATION),
        deceleration(units, dictionary, Object::PROFILE_DECELERATION),
    )
}

/// Reads an acceleration in increments/s², within 60C5h.
pub(super) fn acceleration(units: &Units, dictionary: &Dictionary, object: Object) -> f64 {
    units.size(dictionary, object).min(units.limit(dictionary, Object::MAX_ACCELERATION))
}

/// Reads a deceleration in increments/s², within 60C6h.
pub(super) fn deceleration(units: &Units, dictionary: &Dictionary, object: Object) -> f64 {
    units.size(dictionary, object).min(units.limit(dictionary, Object::MAX_DECELERATION))
}

/// Returns a target in position units, within 607Dh. Limits in the wrong order, and the ends of the
/// counter, are no limits: a relative target may pass the ends.
pub(super) fn position(dictionary: &Dictionary, units: f64) -> LimitedValue {
    let low = signed(dictionary, Object::MIN_POSITION_LIMIT);
    let high = signed(dictionary, Object::MAX_POSITION_LIMIT);
    if low >= high || (low, high) == (i32::MIN, i32::MAX) {
        return LimitedValue { value: units, is_limited: false };
    }
    let (low, high) = (f64::from(low), f64::from(high));
    LimitedValue { value: units.clamp(low, high), is_limited: units < low || units > high }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::motion::fixture::{INCREMENTS, drive, put};

    #[test]
    fn target_stays_within_configured_position_limits() {
        let mut dictionary = drive();
        for (low, high, target, left) in [
            (0, 0, 9.0, 9.0),
            (5, -5, 9.0, 9.0),
            (i32::MIN, i32::MAX, 4e9, 4e9),
            (i32::MIN, 5, 4e9, 5.0),
            (-5, 5, 9.0, 5.0),
            (-5, 5, -9.0, -5.0),
            (-5, 5, 4.0, 4.0),
        ] {
            put(&mut dictionary, Object::MIN_POSITION_LIMIT, i32::cast_unsigned(low));
            put(&mut dictionary, Object::MAX_POSITION_LIMIT, i32::cast_unsigned(high));
            let limited = position(&dictionary, target);
            assert_eq!(limited.value, left);
            assert_eq!(limited.is_limited, left != target);
        }
    }

    #[test]
    fn top_speed_is_the_lower_of_motor_and_profile_limit() {
        let mut dictionary = drive();
        let units = Units::from_dictionary(&dictionary, INCREMENTS);
        assert_eq!(top_speed(&units, &dictionary), 1_600_000.0, "6000 rpm are 1,638,400");
        put(&mut dictionary, Object::MAX_MOTOR_SPEED, 60);
        assert_eq!(top_speed(&units, &dictionary), 16_384.0);
    }

    #[test]
    fn absent_limits_are_no_limits() {
        let mut dictionary = drive();
        let units = Units::from_dictionary(&dictionary, INCREMENTS);
        for object in [Object::MAX_TORQUE, Object::MAX_CURRENT, Object::POSITIVE_TORQUE_LIMIT] {
            dictionary.remove(object);
        }
        let limits = TorqueLimits::from_dictionary(&dictionary);
        assert_eq!(limits.clamp(9_999.0).value, 9_999.0);
        for object in [Object::MAX_MOTOR_SPEED, Object::MAX_PROFILE_VELOCITY] {
            dictionary.remove(object);
        }
        assert_eq!(top_speed(&units, &dictionary), f64::INFINITY);
    }

    proptest! {
        #[test]
        fn torque_limits_apply_per_direction(
            max: u16, current: u16, positive: u16, negative: u16, wanted: f64,
        ) {
            let mut dictionary = drive();
            for (object, limit) in [
                (Object::MAX_TORQUE, max),
                (Object::MAX_CURRENT, current),
                (Object::POSITIVE_TORQUE_LIMIT, positive),
                (Object::NEGATIVE_TORQUE_LIMIT, negative),
            ] {
                put(&mut dictionary, object, u32::from(limit));
            }
            let limited = TorqueLimits::from_dictionary(&dictionary).clamp(wanted);
            let high = f64::from(max.min(current).min(positive));
            let low = -f64::from(max.min(current).min(negative));
            prop_assert!((low..=high).contains(&limited.value));
            prop_assert_eq!(limited.is_limited, limited.value != wanted);
        }
    }
}
