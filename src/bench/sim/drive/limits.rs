//! Torque and speed limits of a drive: 6072h, 6073h, 60E0h, 60E1h, 6080h.
//!
//! The software position limits (607Dh) apply to set-points, in the [modes of operation](crate::motion).

use canopen::nameplate::units::SiUnit;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Limits of one drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    /// Positive limit, in ‰ of rated torque, not negative.
    positive: f64,
    /// Magnitude of the negative limit, in ‰ of rated torque, not negative.
    negative: f64,
    /// Trip speed, in increments/s.
    max_speed: f64,
}

impl Limits {
    /// Reads the limits from `dictionary`. An absent object is no limit. The encoder has `increments` per revolution.
    pub(super) fn from_dictionary(dictionary: &Dictionary, increments: f64) -> Self {
        let limit = |object| dictionary.optional(object).map_or(f64::INFINITY, f64::from);
        // Torque is proportional to current: both limits have the same unit.
        let both = limit(Object::MAX_TORQUE).min(limit(Object::MAX_CURRENT));
        let unit = dictionary.optional(Object::VELOCITY_UNIT).and_then(|unit| SiUnit(unit).rpm());
        let max_rpm = limit(Object::MAX_MOTOR_SPEED) * unit.unwrap_or(1.0);
        let max_speed = TRIP_RATIO * max_rpm / 60.0 * increments;
        Self {
            positive: both.min(limit(Object::POSITIVE_TORQUE_LIMIT)),
            negative: both.min(limit(Object::NEGATIVE_TORQUE_LIMIT)),
            max_speed: if increments > 0.0 { max_speed } else { f64::INFINITY },
        }
    }

    /// Returns `per_mille` of rated torque within the limits, 0 for NaN.
    pub(super) fn clamp(&self, per_mille: f64) -> f64 {
        if per_mille.is_nan() { 0.0 } else { per_mille.clamp(-self.negative, self.positive) }
    }

    /// Returns whether `velocity`, in increments/s, exceeds the trip speed.
    pub(super) fn is_too_fast(&self, velocity: f64) -> bool {
        velocity.abs() > self.max_speed
    }
}

/// Trip speed relative to 6080h: a velocity loop overshoots it a little.
const TRIP_RATIO: f64 = 1.1;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::NodeId;
    use canopen::eds::Eds;

    const INCREMENTS: f64 = 16_384.0;

    fn dictionary() -> Dictionary {
        let eds = Eds::parse(include_bytes!("../../../../eds/frhc_drive.eds")).unwrap();
        Dictionary::new(&eds, NodeId::new(1).unwrap())
    }

    #[test]
    fn overspeed_trips_ten_percent_above_6080h() {
        let mut dictionary = dictionary();
        dictionary.set(Object::MAX_MOTOR_SPEED, &3_000_u32.to_le_bytes());
        let limits = Limits::from_dictionary(&dictionary, INCREMENTS);
        let nominal = 50.0 * INCREMENTS;
        for (share, is_too_fast) in [(1.0, false), (1.09, false), (1.11, true)] {
            assert_eq!(limits.is_too_fast(share * nominal), is_too_fast, "{share}");
            assert_eq!(limits.is_too_fast(-share * nominal), is_too_fast, "{share}");
        }
    }

    #[test]
    fn speed_limit_is_in_the_velocity_unit() {
        let mut dictionary = dictionary();
        dictionary.set(Object::MAX_MOTOR_SPEED, &1_u32.to_le_bytes());
        dictionary.set(Object::VELOCITY_UNIT, &0x00B4_0300_u32.to_le_bytes());
        let limits = Limits::from_dictionary(&dictionary, 1_000.0);
        assert!(limits.is_too_fast(1_101.0) && !limits.is_too_fast(1_099.0), "one turn per second");
    }

    #[test]
    fn absent_limits_are_no_limits() {
        let mut dictionary = dictionary();
        for object in [
            Object::MAX_TORQUE,
            Object::MAX_CURRENT,
            Object::POSITIVE_TORQUE_LIMIT,
            Object::NEGATIVE_TORQUE_LIMIT,
            Object::MAX_MOTOR_SPEED,
        ] {
            dictionary.remove(object);
        }
        let limits = Limits::from_dictionary(&dictionary, INCREMENTS);
        assert!((limits.clamp(-9_999.0) + 9_999.0).abs() <= 0.0);
        assert!(!limits.is_too_fast(1e12));
    }

    #[test]
    fn overspeed_is_that_of_the_motor_whatever_608fh_holds() {
        let mut dictionary = dictionary();
        dictionary.set(Object::MAX_MOTOR_SPEED, &60_u32.to_le_bytes());
        let is_right = |dictionary: &Dictionary| {
            let limits = Limits::from_dictionary(dictionary, 1_000.0);
            limits.is_too_fast(1_101.0) && !limits.is_too_fast(1_099.0)
        };
        dictionary.set(Object::ENCODER_INCREMENTS, &1_u32.to_le_bytes());
        assert!(is_right(&dictionary));
        dictionary.remove(Object::ENCODER_INCREMENTS);
        assert!(is_right(&dictionary));
    }

    proptest! {
        #[test]
        fn torque_stays_within_every_limit(
            limits in [0..=3_000_u16, 0..=3_000, 0..=3_000, 0..=3_000], asked in -1e5..1e5_f64,
        ) {
            let mut dictionary = dictionary();
            let objects = [
                Object::MAX_TORQUE,
                Object::MAX_CURRENT,
                Object::POSITIVE_TORQUE_LIMIT,
                Object::NEGATIVE_TORQUE_LIMIT,
            ];
            for (object, limit) in objects.into_iter().zip(limits) {
                prop_assert!(dictionary.set(object, &limit.to_le_bytes()));
            }
            let given = Limits::from_dictionary(&dictionary, INCREMENTS).clamp(asked);
            let [torque, current, positive, negative] = limits.map(f64::from);
            prop_assert!(given.abs() <= torque.min(current));
            prop_assert!(-negative <= given && given <= positive);
            prop_assert!(given * asked >= 0.0 && given.abs() <= asked.abs());
        }
    }

    #[test]
    fn nan_demand_gives_zero_torque() {
        assert!(Limits::from_dictionary(&dictionary(), INCREMENTS).clamp(f64::NAN).abs() <= 0.0);
    }
}
