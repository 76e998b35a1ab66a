//! Conversion between encoder increments and the master's units (CiA 402-2, factor group).
//!
//! 60A8h names the position unit. One position unit is `608Fh · 6091h / 6092h` increments: increments per motor revolution,
//! motor revolutions per shaft revolution, feed per shaft revolution. Without 6092h the feed is 608Fh: the unit is an
//! increment before the gear. Velocities are per s, with 6090h instead of 608Fh; accelerations are per s². 607Eh inverts the
//! signs of positions and velocities, not of torques. With an angle as unit, 608Fh and 6092h do not matter: a shaft
//! revolution behind 6091h is a full angle. 6093h of older dictionaries multiplies the increments of a unit. Positions wrap
//! within 607Bh, unless it is 0 to 0.
//!
//! The encoder itself does not depend on 608Fh: index pulses and motor speeds are those of the motor.

use canopen::object::Object;
use canopen_device::dictionary::Dictionary;
use units::math;

/// Factors of the factor group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Units {
    /// Increments per motor revolution of the encoder, positive; 608Fh should hold it.
    encoder: f64,
    /// Increments per position unit, positive.
    scale: f64,
    /// Increments/s per velocity unit, positive.
    velocity_scale: f64,
    /// Sign of positions, 1 or -1.
    position_sign: f64,
    /// Sign of velocities, 1 or -1.
    velocity_sign: f64,
    /// Lowest and highest position unit (607Bh), beyond which positions wrap; `None` for 32 bits.
    range: Option<[f64; 2]>,
}

impl Default for Units {
    /// Returns one increment per unit.
    fn default() -> Self {
        Self {
            encoder: 1.0,
            scale: 1.0,
            velocity_scale: 1.0,
            position_sign: 1.0,
            velocity_sign: 1.0,
            range: None,
        }
    }
}

impl Units {
    /// Reads the factors of a drive, whose encoder has `increments` per revolution.
    pub(super) fn from_dictionary(dictionary: &Dictionary, increments: f64) -> Self {
        let mut units = Self { encoder: increments, ..Self::default() };
        units.read(dictionary);
        units
    }

    /// Reads the factors again.
    pub(super) fn read(&mut self, dictionary: &Dictionary) {
        let turn = ratio(dictionary, Object::ENCODER_INCREMENTS, Object::ENCODER_REVOLUTIONS)
            .unwrap_or(self.encoder);
        let velocity_turn =
            ratio(dictionary, Object::VELOCITY_INCREMENTS, Object::VELOCITY_REVOLUTIONS)
                .unwrap_or(turn);
        let gear =
            ratio(dictionary, Object::GEAR_MOTOR_REVOLUTIONS, Object::GEAR_SHAFT_REVOLUTIONS)
                .unwrap_or(1.0);
        let feed = ratio(dictionary, Object::FEED, Object::FEED_REVOLUTIONS).unwrap_or(turn);
        let factor = ratio(dictionary, Object::POSITION_FACTOR, Object::POSITION_FACTOR_DIVISOR)
            .unwrap_or(1.0);
        let unit = dictionary.optional(Object::POSITION_UNIT);
        let scale = match unit.and_then(angles_per_revolution) {
            Some(units) => self.encoder * gear / units,
            None => turn * gear / feed,
        };
        let polarity = dictionary.unsigned(Object::POLARITY);
        let sign = |bit: u32| if polarity & bit == 0 { 1.0 } else { -1.0 };
        *self = Self {
            encoder: self.encoder,
            scale: scale * factor,
            velocity_scale: velocity_turn * gear / feed,
            position_sign: sign(POSITION_POLARITY),
            velocity_sign: sign(VELOCITY_POLARITY),
            range: range(dictionary),
        };
    }

    /// Returns whether the factors depend on `object`.
    pub(super) fn depend_on(object: Object) -> bool {
        [
            Object::ENCODER_INCREMENTS,
            Object::VELOCITY_INCREMENTS,
            Object::GEAR_MOTOR_REVOLUTIONS,
            Object::FEED,
            Object::POLARITY,
            Object::POSITION_FACTOR,
            Object::POSITION_UNIT,
            Object::MIN_POSITION_RANGE,
        ]
        .iter()
        .any(|factor| factor.index == object.index)
    }

    /// Converts a distance in position units to increments.
    pub(super) fn increments(&self, units: f64) -> f64 {
        units * self.scale * self.position_sign
    }

    /// Converts a distance in increments to position units.
    pub(super) fn position_units(&self, increments: f64) -> f64 {
        increments / self.scale * self.position_sign
    }

    /// Converts a distance from home in increments to the position that 6064h shows.
    pub(super) fn shown(&self, increments: f64) -> i32 {
        let units = self.position_units(increments);
        match self.range {
            Some([low, high]) => {
                saturated(low + (units.round() - low).rem_euclid(high - low + 1.0))
            }
            None => wrapped(units),
        }
    }

    /// Converts a velocity to increments/s.
    pub(super) fn velocity(&self, units: f64) -> f64 {
        units * self.velocity_scale * self.velocity_sign
    }

    /// Converts increments/s to a velocity.
    pub(super) fn velocity_units(&self, increments: f64) -> f64 {
        increments / self.velocity_scale * self.velocity_sign
    }

    /// Reads an unsigned object (limit, window, acceleration) in increments (/s, /s²).
    pub(super) fn size(&self, dictionary: &Dictionary, object: Object) -> f64 {
        f64::from(dictionary.unsigned(object)) * self.scale
    }

    /// Reads a limit in increments (/s, /s²); infinite if absent.
    pub(super) fn limit(&self, dictionary: &Dictionary, object: Object) -> f64 {
        dictionary.optional(object).map_or(f64::INFINITY, |limit| f64::from(limit) * self.scale)
    }

    /// Returns the increments per motor revolution.
    pub(super) const fn increments_per_revolution(&self) -> f64 {
        self.encoder
    }

    /// Converts a motor speed in rpm to increments/s.
    pub(super) fn motor_speed(&self, turns_per_minute: f64) -> f64 {
        turns_per_minute / SECONDS_PER_MINUTE * self.encoder
    }
}

/// Returns a ratio of two objects, `None` if absent; one with a zero counts as 1.
fn ratio(dictionary: &Dictionary, over: Object, under: Object) -> Option<f64> {
    Some(match (dictionary.optional(over)?, dictionary.optional(under).unwrap_or(1)) {
        (0, _) | (_, 0) => 1.0,
        (over, under) => f64::from(over) / f64::from(under),
    })
}

/// Returns the number of angle units of 60A8h in a revolution; `None` for another unit. From its highest byte: power of
/// ten, unit, and two bytes of zero (CiA 303-2).
fn angles_per_revolution(unit: u32) -> Option<f64> {
    let [power, unit, 0, 0] = unit.to_be_bytes() else { return None };
    let angle = match unit {
        0x10 => std::f64::consts::TAU,
        0x41 => 360.0,
        0xB4 => 1.0,
        _ => return None,
    };
    Some(angle * math::powf(10.0, -f64::from(power.cast_signed())))
}

/// Returns the position range (607Bh); `None` for 0 to 0, no range, or an absent one.
fn range(dictionary: &Dictionary) -> Option<[f64; 2]> {
    let ends = [Object::MIN_POSITION_RANGE, Object::MAX_POSITION_RANGE];
    let [low, high] = ends.map(|end| dictionary.optional(end).map(u32::cast_signed));
    let (low, high) = low.zip(high).filter(|(low, high)| low < high)?;
    Some([low.into(), high.into()])
}

/// Polarity of positions, bit 7 of 607Eh.
const POSITION_POLARITY: u32 = 1 << 7;
/// Polarity of velocities, bit 6 of 607Eh.
const VELOCITY_POLARITY: u32 = 1 << 6;
const SECONDS_PER_MINUTE: f64 = 60.0;

/// Reads a signed object of 32 bits; zero if absent.
pub(super) fn signed(dictionary: &Dictionary, object: Object) -> i32 {
    dictionary.unsigned(object).cast_signed()
}

/// Rounds to the low 32 bits: a counter wraps.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "a counter of 32 bits wraps; NaN becomes 0"
)]
pub(crate) fn wrapped(number: f64) -> i32 {
    number.round() as i64 as i32
}

/// Rounds to i32; saturates.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "a float-to-integer cast saturates; NaN becomes 0"
)]
pub(super) fn saturated(number: f64) -> i32 {
    number.round() as i32
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "whole numbers are exact, and limits are kept exactly")]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::motion::fixture::{INCREMENTS, drive, put};

    #[test]
    fn default_unit_is_one_increment() {
        let units = Units::from_dictionary(&drive(), INCREMENTS);
        assert_eq!((units.increments(12.0), units.position_units(12.0)), (12.0, 12.0));
        assert_eq!((units.velocity(-7.0), units.velocity_units(-7.0)), (-7.0, -7.0));
    }

    #[test]
    fn shaft_revolution_is_the_feed_in_units() {
        let mut dictionary = drive();
        put(&mut dictionary, Object::GEAR_MOTOR_REVOLUTIONS, 40);
        put(&mut dictionary, Object::FEED, 360_000);
        let units = Units::from_dictionary(&dictionary, INCREMENTS);
        assert_eq!(units.position_units(16_384.0 * 40.0), 360_000.0);
        assert_eq!(units.velocity(360_000.0), 16_384.0 * 40.0);
    }

    #[test]
    fn angle_is_that_of_the_shaft_behind_the_gear() {
        let mut dictionary = drive();
        put(&mut dictionary, Object::GEAR_MOTOR_REVOLUTIONS, 40);
        put(&mut dictionary, Object::FEED, 360_000);
        dictionary.set(Object::POSITION_UNIT, &0xFF41_0000_u32.to_le_bytes());
        let units = Units::from_dictionary(&dictionary, INCREMENTS);
        assert_eq!(units.position_units(INCREMENTS * 40.0), 3_600.0);
    }

    #[test]
    fn position_factor_is_increments_per_unit() {
        let infranor = include_bytes!("../../../../eds/drives/infranor-easy-ak.eds");
        let eds = canopen::eds::Eds::parse(infranor).unwrap();
        let mut dictionary = Dictionary::new(&eds, canopen::NodeId::new(1).unwrap());
        assert_eq!(
            Units::from_dictionary(&dictionary, INCREMENTS).position_units(900.0),
            900.0,
            "4096:4096"
        );
        put(&mut dictionary, Object::POSITION_FACTOR_DIVISOR, 1_024);
        assert_eq!(Units::from_dictionary(&dictionary, INCREMENTS).position_units(900.0), 225.0);
    }

    #[test]
    fn position_wraps_within_607bh() {
        let mut dictionary = drive();
        let shown = |dictionary: &Dictionary, increments| {
            Units::from_dictionary(dictionary, INCREMENTS).shown(increments)
        };
        assert_eq!(shown(&dictionary, -5.0), -5, "0 to 0 is no range");
        put(&mut dictionary, Object::MIN_POSITION_RANGE, (-100_i32).cast_unsigned());
        put(&mut dictionary, Object::MAX_POSITION_RANGE, 99);
        for (increments, position) in [(99.0, 99), (100.0, -100), (-101.0, 99), (450.0, 50)] {
            assert_eq!(shown(&dictionary, increments), position, "{increments}");
        }
    }

    #[test]
    fn gear_of_two_halves_the_position() {
        let mut dictionary = drive();
        put(&mut dictionary, Object::GEAR_MOTOR_REVOLUTIONS, 2);
        assert_eq!(Units::from_dictionary(&dictionary, INCREMENTS).position_units(1_000.0), 500.0);
        dictionary.remove(Object::FEED);
        assert_eq!(Units::from_dictionary(&dictionary, INCREMENTS).position_units(1_000.0), 500.0);
    }

    #[test]
    fn encoder_resolution_stored_wrong_scales_the_position() {
        let mut dictionary = drive();
        put(&mut dictionary, Object::ENCODER_INCREMENTS, 8_192);
        let units = Units::from_dictionary(&dictionary, INCREMENTS);
        assert_eq!(units.position_units(1_000.0), 2_000.0, "6092h has 16,384 units per turn");
    }

    #[test]
    fn unused_factors_leave_the_motor_its_revolution() {
        let mut dictionary = drive();
        put(&mut dictionary, Object::ENCODER_INCREMENTS, 1);
        put(&mut dictionary, Object::VELOCITY_INCREMENTS, 1);
        put(&mut dictionary, Object::FEED, 1);
        put(&mut dictionary, Object::GEAR_MOTOR_REVOLUTIONS, 2);
        let units = Units::from_dictionary(&dictionary, INCREMENTS);
        assert_eq!((units.position_units(1_000.0), units.velocity_units(1_000.0)), (500.0, 500.0));
        assert_eq!(units.increments_per_revolution(), INCREMENTS);
        assert_eq!(units.motor_speed(60.0), INCREMENTS);
    }

    #[test]
    fn velocity_encoder_resolution_scales_velocities_only() {
        let mut dictionary = drive();
        put(&mut dictionary, Object::VELOCITY_INCREMENTS, 32_768);
        let units = Units::from_dictionary(&dictionary, INCREMENTS);
        assert_eq!(
            (units.position_units(1_000.0), units.velocity_units(1_000.0)),
            (1_000.0, 500.0)
        );
    }

    #[test]
    fn drive_without_factor_group_counts_increments() {
        let mut dictionary = drive();
        for object in [
            Object::ENCODER_INCREMENTS,
            Object::VELOCITY_INCREMENTS,
            Object::GEAR_MOTOR_REVOLUTIONS,
            Object::FEED,
        ] {
            dictionary.remove(object);
        }
        let units = Units::from_dictionary(&dictionary, 4_000.0);
        assert_eq!((units.position_units(7.0), units.velocity_units(7.0)), (7.0, 7.0));
        assert_eq!(units.motor_speed(60.0), 4_000.0);
    }

    #[test]
    fn polarity_bits_invert_positions_and_velocities() {
        for (polarity, position, velocity) in
            [(0x00, 1.0, 1.0), (0x80, -1.0, 1.0), (0x40, 1.0, -1.0), (0xC0, -1.0, -1.0)]
        {
            let mut dictionary = drive();
            put(&mut dictionary, Object::POLARITY, polarity);
            let units = Units::from_dictionary(&dictionary, INCREMENTS);
            assert_eq!((units.increments(1.0), units.position_units(1.0)), (position, position));
            assert_eq!((units.velocity(1.0), units.velocity_units(1.0)), (velocity, velocity));
        }
    }

    #[test]
    fn motor_speed_ignores_the_gear() {
        let mut dictionary = drive();
        put(&mut dictionary, Object::GEAR_MOTOR_REVOLUTIONS, 40);
        assert_eq!(Units::from_dictionary(&dictionary, INCREMENTS).motor_speed(60.0), 16_384.0);
    }

    proptest! {
        #[test]
        fn conversion_there_and_back_is_the_identity(
            gear in 1_u32.., shaft in 1_u32.., feed in 1_u32.., polarity: u8, distance: i32,
        ) {
            let mut dictionary = drive();
            put(&mut dictionary, Object::GEAR_MOTOR_REVOLUTIONS, gear);
            put(&mut dictionary, Object::GEAR_SHAFT_REVOLUTIONS, shaft);
            put(&mut dictionary, Object::FEED, feed);
            put(&mut dictionary, Object::POLARITY, u32::from(polarity));
            let units = Units::from_dictionary(&dictionary, INCREMENTS);
            let distance = f64::from(distance);
            let tolerance = 1e-12 * distance.abs();
            prop_assert!((units.position_units(units.increments(distance)) - distance).abs() <= tolerance);
            prop_assert!((units.velocity_units(units.velocity(distance)) - distance).abs() <= tolerance);
        }

        #[test]
        fn positions_wrap_and_rates_saturate(number: i32, turns in -1_000..1_000) {
            let beyond = f64::from(number) + f64::from(turns) * 4_294_967_296.0;
            prop_assert_eq!(wrapped(beyond), number);
            prop_assert!(turns < 1 || saturated(beyond) == i32::MAX);
            prop_assert!(turns > -1 || saturated(beyond) == i32::MIN);
        }
    }
}
