//! Nameplate of a drive: comparison of stored sign, scale and ratings with the configuration.
//!
//! The maker's tool stores them in the drive, and they change the meaning of PDOs. Polarity turns the sign of 6064h, the
//! gear ratio scales it, and rated torque is the unit of 6071h. Every boot reads those that the drive has, and compares
//! them. The master does not write them.
//!
//! | object       | expected                                              |
//! |--------------|-------------------------------------------------------|
//! | 607Eh        | polarity of the plan                                  |
//! | 6090h        | anything: only that it does not change                |
//! | 6075h, 6076h | ratings of the plan, to within 1 % or one unit        |
//! | 60E0h, 60E1h | the capacity of the joint, or more                    |
//! | 60AAh        | anything, and it is not read again                    |
//! | 6502h        | cyclic synchronous torque                             |
//!
//! [`position_scale`] has 608Fh, 6091h and 6092h, [`units`] 60A8h, 60A9h, 6093h, 6094h and 607Bh.

mod misfit;
pub mod position_scale;
mod ratio;
mod stored_value;
pub mod units;

pub use misfit::NameplateMisfit;
pub use ratio::Ratio;
pub use stored_value::StoredValue;

use crate::nameplate::misfit::number;
use crate::nameplate::position_scale::PositionScale;
use crate::nameplate::units::{SiUnit, Units};
use crate::object::Object;

/// Relative deviation of a rating that is a matter of rounding.
const ROUNDING: f64 = 0.01;

/// Supported drive modes (6502h): cyclic synchronous torque.
pub const HAS_CYCLIC_TORQUE: u32 = 1 << 9;

/// Rated value in the unit of its object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rating {
    /// Value in `unit`, as the configuration gives it.
    pub value: f64,
    /// Unit: `mN·m`.
    pub unit: &'static str,
}

impl Rating {
    /// Returns the nearest integer; the largest for a value beyond.
    #[expect(
        clippy::as_conversions,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a float that is too large becomes the largest number, NaN becomes zero"
    )]
    pub fn rounded(&self) -> u32 {
        self.value.round() as u32
    }
}

/// Expected values.
#[derive(Clone, Debug, PartialEq)]
pub struct Nameplate {
    /// Polarity (607Eh).
    pub polarity: u8,
    /// Counts of 6064h (608Fh, 6091h, 6092h, 60A8h).
    pub scale: PositionScale,
    /// Rated current (6075h), if the configuration has it.
    pub rated_current: Option<Rating>,
    /// Rated torque (6076h).
    pub rated_torque: Rating,
    /// Capacity of the joint in per mille of rated torque, which 60E0h and 60E1h must allow; `None` compares neither.
    pub capacity: Option<u16>,
    /// Velocity unit and range of positions (60A9h, 607Bh).
    pub units: Units,
    /// Supported modes (6502h) as the configuration states them; `None` expects cyclic synchronous torque among them.
    pub modes: Option<u32>,
}

const POLARITY: &str = "set it with the maker's tool or [[joint.boot.write]], or state it as drive_polarity and check the \
    sign of gear_ratio";
const CURRENT: &str = "set it with the maker's tool, or correct rated_current_a";
const TORQUE: &str =
    "set it with the maker's tool, or correct rated_torque_nm or rated_torque_unit";
const TORQUE_LIMIT: &str =
    "raise it with the maker's tool, or lower max_torque_nm (max_force_n of a sliding joint)";
const MODE: &str = "this drive lists no cyclic synchronous torque; if it has it all the same, state its value as \
    drive_modes";

impl Nameplate {
    /// Objects to read, in order.
    pub const OBJECTS: [Object; 23] = [
        Object::POLARITY,
        Object::ENCODER_INCREMENTS,
        Object::ENCODER_REVOLUTIONS,
        Object::VELOCITY_INCREMENTS,
        Object::VELOCITY_REVOLUTIONS,
        Object::GEAR_MOTOR_REVOLUTIONS,
        Object::GEAR_SHAFT_REVOLUTIONS,
        Object::FEED,
        Object::FEED_REVOLUTIONS,
        Object::RATED_CURRENT,
        Object::RATED_TORQUE,
        Object::POSITIVE_TORQUE_LIMIT,
        Object::NEGATIVE_TORQUE_LIMIT,
        Object::POSITION_UNIT,
        Object::VELOCITY_UNIT,
        Object::ACCELERATION_UNIT,
        Object::POSITION_FACTOR,
        Object::POSITION_FACTOR_DIVISOR,
        Object::VELOCITY_FACTOR,
        Object::VELOCITY_FACTOR_DIVISOR,
        Object::MIN_POSITION_RANGE,
        Object::MAX_POSITION_RANGE,
        Object::SUPPORTED_MODES,
    ];

    /// Compares the values read from a drive; absent objects pass.
    ///
    /// # Errors
    /// Returns the first value that differs.
    pub fn judge(&self, held: &[StoredValue]) -> Result<(), NameplateMisfit> {
        self.units.judge(held, self.scale.unit)?;
        let value = |object: Object| held.iter().find(|it| it.object == object).map(|it| it.value);
        let misfit = |name, object: Object, found, expected, remedy| {
            let object = Object { sub: 0, ..object };
            Err(NameplateMisfit { name, object, found, expected, remedy })
        };
        if let Some(found) = value(Object::POLARITY).filter(|found| *found != self.polarity.into())
        {
            let expected = format!("{:02X}h", self.polarity);
            let found = format!("{found:02X}h");
            return misfit("polarity", Object::POLARITY, found, expected, POLARITY);
        }
        self.scale.judge(held)?;
        for (name, object, expected, remedy) in [
            ("rated current", Object::RATED_CURRENT, self.rated_current, CURRENT),
            ("rated torque", Object::RATED_TORQUE, Some(self.rated_torque), TORQUE),
        ] {
            let Some((found, Rating { value, unit })) = value(object).zip(expected) else {
                continue;
            };
            let off = (f64::from(found) - value).abs();
            if !(off <= 1.0 || off <= ROUNDING * value) || found == 0 && value >= 0.5 {
                let expected = format!("{} {unit}", number(value));
                return misfit(name, object, format!("{found} {unit}"), expected, remedy);
            }
        }
        for (name, object) in [
            ("positive torque limit", Object::POSITIVE_TORQUE_LIMIT),
            ("negative torque limit", Object::NEGATIVE_TORQUE_LIMIT),
        ] {
            let limits = value(object).zip(self.capacity);
            if let Some((found, least)) = limits.filter(|(found, least)| *found < (*least).into()) {
                let expected = format!("at least {least} ‰");
                return misfit(name, object, format!("{found} ‰"), expected, TORQUE_LIMIT);
            }
        }
        let Some(found) = value(Object::SUPPORTED_MODES) else { return Ok(()) };
        let (is_right, expected) = match self.modes {
            Some(modes) => (found == modes, format!("{modes:08X}h")),
            None => (found & HAS_CYCLIC_TORQUE != 0, "bit 9".to_owned()),
        };
        if is_right {
            return Ok(());
        }
        misfit("supported modes", Object::SUPPORTED_MODES, format!("{found:08X}h"), expected, MODE)
    }
}

const POSITION_UNIT: &str = "set it with the maker's tool or [[joint.boot.write]], or state it as drive_position_unit and give \
    encoder_counts_per_rev in units of 6064h";
const VELOCITY_UNIT: &str = "set it with the maker's tool or [[joint.boot.write]]: max_speed_rad_per_s (max_speed_m_per_s) is \
    written to 6080h in rpm";
const FACTOR: &str = "set both numbers alike with the maker's tool or [[joint.boot.write]], and give \
    encoder_counts_per_rev in units of 6064h";
const RANGE: &str = "widen it, or set both to 0, with the maker's tool or [[joint.boot.write]], or correct limit_deg \
    (limit_m) or zero_counts";

impl Units {
    /// Compares the values read from a drive with a position unit and the others; absent objects pass.
    ///
    /// # Errors
    /// Returns the first value that differs.
    fn judge(&self, held: &[StoredValue], position: SiUnit) -> Result<(), NameplateMisfit> {
        let value = |object: Object| held.iter().find(|it| it.object == object).map(|it| it.value);
        let misfit = |name, object: Object, found, expected, remedy| {
            let object = Object { sub: 0, ..object };
            Err(NameplateMisfit { name, object, found, expected, remedy })
        };
        for (name, object, expected, remedy) in [
            ("position unit", Object::POSITION_UNIT, Some(position), POSITION_UNIT),
            ("velocity unit", Object::VELOCITY_UNIT, self.velocity, VELOCITY_UNIT),
        ] {
            let units = value(object).map(SiUnit).zip(expected);
            if let Some((found, expected)) = units.filter(|(found, expected)| found != expected) {
                return misfit(name, object, found.to_string(), expected.to_string(), remedy);
            }
        }
        for (name, object) in [
            ("position factor", Object::POSITION_FACTOR),
            ("velocity encoder factor", Object::VELOCITY_FACTOR),
        ] {
            let divisor = value(Object { sub: 2, ..object }).unwrap_or(1);
            let factor = value(object).map(|of| Ratio(of, divisor));
            let is_set = |Ratio(of, to): &Ratio| *of != 0 && *to != 0;
            if let Some(found) = factor.filter(|found| is_set(found) && *found != Ratio::ONE) {
                return misfit(name, object, found.to_string(), Ratio::ONE.to_string(), FACTOR);
            }
        }
        let signed = |object, absent| value(object).map_or(absent, u32::cast_signed);
        let found = [
            signed(Object::MIN_POSITION_RANGE, i32::MIN),
            signed(Object::MAX_POSITION_RANGE, i32::MAX),
        ];
        match self.range {
            Some(range) if found != [0, 0] && !contains(found, range) => {
                let expected = format!("at least {}", range_text(range));
                let found = range_text(found);
                misfit("position range limit", Object::MIN_POSITION_RANGE, found, expected, RANGE)
            }
            Some(_) | None => Ok(()),
        }
    }
}

const fn contains([low, high]: [i32; 2], [least, most]: [i32; 2]) -> bool {
    low <= least && most <= high
}

fn range_text([low, high]: [i32; 2]) -> String {
    format!("{low} to {high}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nameplate() -> Nameplate {
        Nameplate {
            polarity: 0,
            scale: PositionScale {
                counts: 16_384,
                unit: SiUnit::INCREMENTS,
                encoder: None,
                gear: Ratio::ONE,
                feed: None,
            },
            rated_current: None,
            rated_torque: Rating { value: 176.5, unit: "mN·m" },
            capacity: Some(800),
            units: Units::default(),
            modes: None,
        }
    }

    fn held(object: Object, value: u32) -> StoredValue {
        StoredValue { object, value, size: 4 }
    }

    fn judged(held: &[StoredValue]) -> String {
        nameplate().judge(held).map_or_else(|misfit| misfit.to_string(), |()| String::new())
    }

    #[test]
    fn drive_without_any_of_the_objects_passes() {
        assert_eq!(judged(&[]), "");
    }

    #[test]
    fn stored_polarity_is_refused_with_both_values() {
        let text = judged(&[held(Object::POLARITY, 0x80)]);
        assert!(text.starts_with("polarity (607Eh) is 80h, expected 00h: set it with"), "{text}");
        let meant = Nameplate { polarity: 0x80, ..nameplate() };
        assert_eq!(meant.judge(&[held(Object::POLARITY, 0x80)]), Ok(()));
    }

    #[test]
    fn ratios_are_compared_as_numbers() {
        let gear = |of, to| {
            judged(&[
                held(Object::GEAR_MOTOR_REVOLUTIONS, of),
                held(Object::GEAR_SHAFT_REVOLUTIONS, to),
            ])
        };
        assert_eq!(gear(5_308_416, 5_308_416), "");
        assert!(gear(2, 1).starts_with("gear ratio (6091h) is 2:1, expected 1:1: "));
        assert!(gear(1, 0).contains("is 1:0"), "and zero equals nothing");
    }

    #[test]
    fn rated_torque_is_compared_but_for_rounding() {
        for (found, is_right) in [(176, true), (177, true), (178, true), (180, false), (0, false)] {
            assert_eq!(
                judged(&[held(Object::RATED_TORQUE, found)]).is_empty(),
                is_right,
                "{found}"
            );
        }
        let text = judged(&[held(Object::RATED_TORQUE, 176_500)]);
        assert!(text.starts_with("rated torque (6076h) is 176500 mN·m, expected 176.5 mN·m: "));
        let current =
            Nameplate { rated_current: Some(Rating { value: 2_100.0, unit: "mA" }), ..nameplate() };
        assert!(current.judge(&[held(Object::RATED_CURRENT, 21)]).is_err());
        assert_eq!(judged(&[held(Object::RATED_CURRENT, 21)]), "", "not configured");
    }

    #[test]
    fn torque_limit_below_the_capacity_is_refused() {
        for object in [Object::POSITIVE_TORQUE_LIMIT, Object::NEGATIVE_TORQUE_LIMIT] {
            assert_eq!(
                (judged(&[held(object, 800)]), judged(&[held(object, 65_535)])),
                Default::default()
            );
            let text = judged(&[held(object, 799)]);
            assert!(text.contains("is 799 ‰, expected at least 800 ‰: raise it"), "{text}");
            let open = Nameplate { capacity: None, ..nameplate() };
            assert_eq!(open.judge(&[held(object, 0)]), Ok(()));
        }
    }

    #[test]
    fn drive_without_cyclic_torque_is_refused() {
        let stated = Nameplate { modes: Some(0x6D), ..nameplate() };
        assert_eq!(stated.judge(&[held(Object::SUPPORTED_MODES, 0x6D)]), Ok(()));
        assert!(stated.judge(&[held(Object::SUPPORTED_MODES, 0x3EF)]).is_err());
        assert_eq!(judged(&[held(Object::SUPPORTED_MODES, 0x3EF)]), "");
        assert!(
            judged(&[held(Object::SUPPORTED_MODES, 0x6D)]).contains("is 0000006Dh, expected bit 9")
        );
    }

    fn judged_units(held: &[(Object, u32)]) -> String {
        let held: Vec<_> =
            held.iter().map(|&(object, value)| StoredValue { object, value, size: 4 }).collect();
        let units = Units { velocity: Some(SiUnit::RPM), range: Some([-200, 300]) };
        units
            .judge(&held, SiUnit::INCREMENTS)
            .map_or_else(|misfit| misfit.to_string(), |()| String::new())
    }

    #[test]
    fn drive_without_any_unit_passes() {
        assert_eq!(judged_units(&[]), "");
        assert_eq!(judged_units(&[(Object::ACCELERATION_UNIT, 7)]), "", "it is printed only");
    }

    #[test]
    fn tenth_of_a_degree_is_no_increment() {
        assert_eq!(judged_units(&[(Object::POSITION_UNIT, 0x00B5_0000)]), "");
        let text = judged_units(&[(Object::POSITION_UNIT, 0xFF41_0000)]);
        assert!(
            text.starts_with(
                "position unit (60A8h) is FF410000h (10^-1 °), expected 00B50000h (increments): set it"
            ),
            "{text}"
        );
        assert!(text.contains("drive_position_unit"), "{text}");
        let stated = SiUnit(0xFF41_0000);
        let held = |value| [StoredValue { object: Object::POSITION_UNIT, value, size: 4 }];
        assert_eq!(Units::default().judge(&held(0xFF41_0000), stated), Ok(()));
        assert!(Units::default().judge(&held(0x00B5_0000), stated).is_err());
    }

    #[test]
    fn velocity_unit_counts_where_a_speed_is_written() {
        let text = judged_units(&[(Object::VELOCITY_UNIT, 0xFDB4_4700)]);
        assert!(text.contains("is FDB44700h (10^-3 rpm), expected 00B44700h (rpm)"), "{text}");
        let held = [StoredValue { object: Object::VELOCITY_UNIT, value: 0, size: 4 }];
        assert_eq!(Units::default().judge(&held, SiUnit::INCREMENTS), Ok(()));
    }

    #[test]
    fn factors_are_ratios_and_zeros_are_unset() {
        for (object, name) in [
            (Object::POSITION_FACTOR, "position factor (6093h)"),
            (Object::VELOCITY_FACTOR, "velocity encoder factor (6094h)"),
        ] {
            let of =
                |over, under| judged_units(&[(object, over), (Object { sub: 2, ..object }, under)]);
            assert_eq!((of(4_096, 4_096), of(0, 0)), (String::new(), String::new()));
            assert_eq!((of(0, 5), of(5, 0)), (String::new(), String::new()));
            assert!(of(4_096, 360).starts_with(&format!("{name} is 4096:360, expected 1:1: ")));
        }
    }

    #[test]
    fn range_contains_that_of_the_joint_or_is_unset() {
        let of = |low: i32, high: i32| {
            judged_units(&[
                (Object::MIN_POSITION_RANGE, low.cast_unsigned()),
                (Object::MAX_POSITION_RANGE, high.cast_unsigned()),
            ])
        };
        assert_eq!((of(0, 0), of(-200, 300)), (String::new(), String::new()));
        assert_eq!(of(i32::MIN, i32::MAX), "");
        for text in [of(-199, 300), of(-200, 299), of(0, 1)] {
            assert!(text.contains("(607Bh) is"), "{text}");
            assert!(text.contains("expected at least -200 to 300: widen it"), "{text}");
        }
        assert_eq!(judged_units(&[(Object::MAX_POSITION_RANGE, 300)]), "", "no lower end");
    }
}
