//! Position scale of a drive: counts of 6064h per revolution of its motor, by 608Fh, 6091h, 6092h and 60A8h (CiA 402-2).
//!
//! | 60A8h               | 6064h per revolution of the motor               | verified by                       |
//! |---------------------|-------------------------------------------------|-----------------------------------|
//! | an angle            | units in a revolution / 6091h                   | 60A8h and 6091h                   |
//! | increments, absent  | 6092h / 6091h; without 6092h 608Fh / 6091h      | 608Fh, 6091h, and 6092h if it has |
//! | any other           | 6092h / 6091h                                   | nothing                           |
//!
//! 1:1 in 608Fh or 6092h is what unused objects read: it leaves the scale open.

use super::misfit::{NameplateMisfit, number};
use super::ratio::Ratio;
use super::stored_value::StoredValue;
use super::units::SiUnit;
use crate::object::Object;

/// Relative difference between `encoder_counts_per_rev`, an integer, and the scale that the objects fix.
const ROUNDING: f64 = 1e-3;

/// Position scale that the configuration states.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionScale {
    /// Counts of 6064h per revolution of the motor.
    pub counts: u32,
    /// Position unit (60A8h).
    pub unit: SiUnit,
    /// Encoder resolution (608Fh); `None` if not stated.
    pub encoder: Option<Ratio>,
    /// Gear ratio (6091h).
    pub gear: Ratio,
    /// Feed constant (6092h); `None` if not stated.
    pub feed: Option<Ratio>,
}

/// Counts that stated objects fix, other than the configured ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contradiction {
    /// Counts of 6064h per revolution of the motor.
    pub counts: f64,
    /// Object that fixes them, beside 6091h: 608Fh, 6092h or 60A8h.
    pub by: Object,
}

impl Contradiction {
    /// Returns the integer to configure; `None` if none is within 0.1 %.
    pub fn nearest(&self) -> Option<f64> {
        let nearest = self.counts.round();
        ((nearest - self.counts).abs() <= ROUNDING * self.counts).then_some(nearest)
    }
}

impl PositionScale {
    /// Returns the feed per revolution of the shaft behind 6091h at which 6064h counts as configured.
    pub fn shaft(&self) -> Option<Ratio> {
        self.gear.times(self.counts)
    }

    /// Compares the configured counts with those that the stated objects fix, in a drive with these objects.
    ///
    /// # Errors
    /// Returns the counts that the stated objects fix.
    pub fn check(&self, has: impl Fn(Object) -> bool) -> Result<(), Contradiction> {
        let factors = Factors { unit: Some(self.unit), ..self.planned(has) };
        self.compare(&factors)
    }

    /// Returns the objects that verify the scale in a drive with these objects; empty if it is stated only.
    pub(crate) fn planned_evidence(&self, has: impl Fn(Object) -> bool) -> &'static [Object] {
        self.planned(has).evidence()
    }

    /// Returns the objects that verify the scale in the values of a drive; empty if it is stated only.
    pub(crate) fn found_evidence(held: &[StoredValue]) -> &'static [Object] {
        Factors::found(held).evidence()
    }

    /// Compares the values read from a drive, 60A8h excepted; absent objects pass.
    ///
    /// # Errors
    /// Returns the first value that differs.
    pub(super) fn judge(&self, held: &[StoredValue]) -> Result<(), NameplateMisfit> {
        let found = Factors::found(held);
        let shaft = self.shaft();
        let usual = [shaft, Some(Ratio::ONE)];
        // Where 6064h does not count increments, their number is not known.
        let of_encoder =
            found.encoder.filter(|_| self.encoder.is_some() || self.unit == SiUnit::INCREMENTS);
        for (name, object, found, expected, remedy) in [
            ("encoder resolution", Object::ENCODER_INCREMENTS, of_encoder, self.encoder, ENCODER),
            ("gear ratio", Object::GEAR_MOTOR_REVOLUTIONS, found.gear, Some(self.gear), GEAR),
            ("feed constant", Object::FEED, found.feed, self.feed, FEED),
        ] {
            let expected: Vec<_> = match expected {
                Some(stated) => vec![stated],
                None => usual.into_iter().flatten().collect(),
            };
            if let Some(found) = found.filter(|found| !expected.contains(found)) {
                let expected: Vec<_> = expected.iter().map(Ratio::to_string).collect();
                let (found, expected) = (found.to_string(), expected.join(" or "));
                return Err(NameplateMisfit {
                    name,
                    object: whole(object),
                    found,
                    expected,
                    remedy,
                });
            }
        }
        self.compare(&found).map_err(|Contradiction { counts, by }| NameplateMisfit {
            name: "position scale",
            object: whole(by),
            found: format!("{} counts of 6064h per revolution of the motor", number(counts)),
            expected: self.counts.to_string(),
            remedy: SCALE,
        })
    }

    fn compare(&self, factors: &Factors) -> Result<(), Contradiction> {
        let Some((counts, by)) = factors.counts() else { return Ok(()) };
        let off = (f64::from(self.counts) - counts).abs();
        let fits = off < 1.0 && off <= ROUNDING * counts;
        if fits { Ok(()) } else { Err(Contradiction { counts, by }) }
    }

    /// Returns the factors of a drive with these objects, as the maker's tool should set them.
    fn planned(&self, has: impl Fn(Object) -> bool) -> Factors {
        let usual = |stated: Option<Ratio>| stated.or(self.shaft());
        Factors {
            unit: has(Object::POSITION_UNIT).then_some(self.unit),
            encoder: usual(self.encoder).filter(|_| has(Object::ENCODER_INCREMENTS)),
            gear: has(Object::GEAR_MOTOR_REVOLUTIONS).then_some(self.gear),
            feed: usual(self.feed).filter(|_| has(Object::FEED)),
        }
    }
}

/// Objects between the encoder and 6064h; `None` if absent.
struct Factors {
    /// Position unit (60A8h).
    unit: Option<SiUnit>,
    /// Encoder resolution (608Fh).
    encoder: Option<Ratio>,
    /// Gear ratio (6091h).
    gear: Option<Ratio>,
    /// Feed constant (6092h).
    feed: Option<Ratio>,
}

impl Factors {
    fn found(held: &[StoredValue]) -> Self {
        let value = |object: Object| held.iter().find(|it| it.object == object).map(|it| it.value);
        let ratio = |of: Object| {
            Some(Ratio(value(of)?, value(Object { sub: of.sub + 1, ..of }).unwrap_or(1)))
        };
        Self {
            unit: value(Object::POSITION_UNIT).map(SiUnit),
            encoder: ratio(Object::ENCODER_INCREMENTS),
            gear: ratio(Object::GEAR_MOTOR_REVOLUTIONS),
            feed: ratio(Object::FEED),
        }
    }

    /// Returns the counts of 6064h per revolution of the motor, and the object that fixes them beside 6091h; `None` if
    /// the objects leave them open.
    fn counts(&self) -> Option<(f64, Object)> {
        let unit = self.unit.unwrap_or(SiUnit::INCREMENTS);
        let is_unused = [self.encoder, self.feed].contains(&Some(Ratio::ONE));
        let (shaft, by) = match (unit.per_revolution(), self.feed, self.encoder) {
            (Some(units), _, _) => (units, Object::POSITION_UNIT),
            (None, _, _) if is_unused => return None,
            (None, Some(feed), _) => (feed.value(), Object::FEED),
            (None, None, Some(encoder)) => (encoder.value(), Object::ENCODER_INCREMENTS),
            (None, None, None) => return None,
        };
        Some((shaft / self.gear.unwrap_or(Ratio::ONE).value(), by))
    }

    /// Returns the objects that verify the scale, 6091h among them; empty if it is stated only.
    fn evidence(&self) -> &'static [Object] {
        const ANGLE: &[Object] = &[Object::POSITION_UNIT, Object::GEAR_MOTOR_REVOLUTIONS];
        const ENCODER: &[Object] = &[Object::ENCODER_INCREMENTS, Object::GEAR_MOTOR_REVOLUTIONS];
        const FEED: &[Object] =
            &[Object::ENCODER_INCREMENTS, Object::GEAR_MOTOR_REVOLUTIONS, Object::FEED];
        if self.gear.is_none() || self.counts().is_none() {
            return &[];
        }
        let unit = self.unit.unwrap_or(SiUnit::INCREMENTS);
        match (unit.per_revolution(), self.encoder, self.feed) {
            (Some(_), _, _) => ANGLE,
            (None, Some(_), None) if unit == SiUnit::INCREMENTS => ENCODER,
            (None, Some(_), Some(_)) if unit == SiUnit::INCREMENTS => FEED,
            (None, _, _) => &[],
        }
    }
}

/// Returns the object without its sub-index.
const fn whole(object: Object) -> Object {
    Object { sub: 0, ..object }
}

const ENCODER: &str = "correct encoder_counts_per_rev, or state the drive's value as drive_encoder";
const GEAR: &str = "set it with the maker's tool or [[joint.boot.write]], or state it as drive_gear and give \
    encoder_counts_per_rev in units of 6064h";
const FEED: &str = "set it with the maker's tool or [[joint.boot.write]], or state it as drive_feed and give \
    encoder_counts_per_rev in units of 6064h";
const SCALE: &str = "correct encoder_counts_per_rev, or set the object with the maker's tool or [[joint.boot.write]]";

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(counts: u32) -> PositionScale {
        PositionScale {
            counts,
            unit: SiUnit::INCREMENTS,
            encoder: None,
            gear: Ratio::ONE,
            feed: None,
        }
    }

    fn angle(counts: u32, unit: u32) -> PositionScale {
        PositionScale { unit: SiUnit(unit), ..scale(counts) }
    }

    fn ratio(object: Object, Ratio(of, to): Ratio) -> [StoredValue; 2] {
        let sub = object.sub + 1;
        [(object, of), (Object { sub, ..object }, to)].map(|(object, value)| StoredValue {
            object,
            value,
            size: 4,
        })
    }

    /// Returns the values of a drive with gear 1:1.
    fn drive(unit: Option<u32>, encoder: Option<u32>, feed: Option<u32>) -> Vec<StoredValue> {
        let unit = unit.map(|value| StoredValue { object: Object::POSITION_UNIT, value, size: 4 });
        let mut drive: Vec<_> = unit.into_iter().collect();
        drive.extend(ratio(Object::GEAR_MOTOR_REVOLUTIONS, Ratio::ONE));
        for (object, value) in [(Object::ENCODER_INCREMENTS, encoder), (Object::FEED, feed)] {
            drive.extend(value.into_iter().flat_map(|of| ratio(object, Ratio(of, 1))));
        }
        drive
    }

    fn indices(objects: &[Object]) -> Vec<u16> {
        objects.iter().map(|object| object.index).collect()
    }

    const CENTIDEGREE: u32 = 0xFE41_0000;
    const MILLIMETRE: u32 = 0xFD01_0000;

    #[test]
    fn angle_unit_fixes_the_counts() {
        assert_eq!(angle(36_000, CENTIDEGREE).check(|_| true), Ok(()));
        let by = Object::POSITION_UNIT;
        let off = Contradiction { counts: 36_000.0, by };
        assert_eq!(angle(16_384, CENTIDEGREE).check(|_| true), Err(off));
        assert_eq!(angle(16_384, CENTIDEGREE).check(|_| false), Err(off), "whatever the EDS has");
        let geared = PositionScale { gear: Ratio(36, 1), ..angle(1_000, CENTIDEGREE) };
        assert_eq!(geared.check(|_| true), Ok(()));
        // A thousandth of a radian has no integer in a revolution: the nearest one is right.
        assert_eq!(angle(6_283, 0xFD10_0000).check(|_| true), Ok(()));
        for wrong in [6_282, 6_285] {
            assert!(angle(wrong, 0xFD10_0000).check(|_| true).is_err(), "{wrong}");
        }
        let coarse = angle(6, 0x0010_0000).check(|_| true).unwrap_err();
        assert_eq!(coarse.nearest(), None, "{coarse:?}");
    }

    #[test]
    fn stated_feed_or_encoder_fixes_the_counts() {
        let fed = |feed, gear| PositionScale { feed: Some(feed), gear, ..scale(10_000) };
        assert_eq!(fed(Ratio(360_000, 1), Ratio(36, 1)).check(|_| true), Ok(()));
        let off = fed(Ratio(360_000, 1), Ratio::ONE).check(|_| true).unwrap_err();
        assert_eq!((off.counts, off.by), (360_000.0, Object::FEED));
        assert_eq!(fed(Ratio::ONE, Ratio::ONE).check(|_| true), Ok(()), "unused");
        let geared = PositionScale { encoder: Some(Ratio(4_096, 1)), ..scale(8_192) };
        assert_eq!(geared.check(|_| true), Ok(()), "by 6092h, which the boot compares");
        let off = geared.check(|object| object != Object::FEED).unwrap_err();
        assert_eq!((off.counts, off.by), (4_096.0, Object::ENCODER_INCREMENTS));
    }

    #[test]
    fn evidence_depends_on_the_unit() {
        let found = |unit, encoder, feed| {
            indices(PositionScale::found_evidence(&drive(unit, encoder, feed)))
        };
        let increments = Some(SiUnit::INCREMENTS.0);
        for unit in [None, increments] {
            assert_eq!(found(unit, Some(16_384), None), [0x608F, 0x6091]);
            assert_eq!(found(unit, Some(16_384), Some(16_384)), [0x608F, 0x6091, 0x6092]);
            assert_eq!(found(unit, Some(16_384), Some(1)), [], "a unit is increment or revolution");
            assert_eq!(found(unit, Some(1), Some(16_384)), []);
            assert_eq!(found(unit, None, Some(16_384)), []);
        }
        assert_eq!(found(Some(CENTIDEGREE), Some(16_384), Some(1)), [0x60A8, 0x6091]);
        assert_eq!(found(Some(CENTIDEGREE), None, None), [0x60A8, 0x6091]);
        // Metres; increments with a prefix; an angle with a denominator, and with a fourth byte.
        for unit in [MILLIMETRE, 0xFDB5_0000, 0xFE41_0300, 0xFE41_0001] {
            assert_eq!(found(Some(unit), Some(16_384), Some(16_384)), [], "{unit:X}h");
        }
        let mut no_gear = drive(Some(CENTIDEGREE), Some(16_384), None);
        no_gear.retain(|held| held.object.index != Object::GEAR_MOTOR_REVOLUTIONS.index);
        assert_eq!(indices(PositionScale::found_evidence(&no_gear)), []);
    }

    #[test]
    fn stated_objects_are_the_only_accepted_ones() {
        let judge = |scale: &PositionScale, encoder, feed| {
            let unit = Some(scale.unit.0);
            let judged = scale.judge(&drive(unit, Some(encoder), Some(feed)));
            judged.map_or_else(|misfit| misfit.to_string(), |()| String::new())
        };
        let usual = scale(16_384);
        for (encoder, feed) in [(16_384, 16_384), (16_384, 1), (1, 1), (1, 16_384)] {
            assert_eq!(judge(&usual, encoder, feed), "", "{encoder} {feed}");
        }
        assert!(judge(&usual, 4_096, 16_384).contains("608Fh) is 4096:1, expected 16384:1 or 1:1"));
        assert!(judge(&usual, 16_384, 360).contains("6092h) is 360:1, expected 16384:1 or 1:1"));
        // The encoder of a drive that counts angles does not matter; a feed must be that angle's.
        let degrees = angle(36_000, CENTIDEGREE);
        assert_eq!(judge(&degrees, 16_384, 1), "");
        assert!(
            judge(&degrees, 16_384, 16_384).contains("6092h) is 16384:1, expected 36000:1 or 1:1")
        );
        let stated = PositionScale { encoder: Some(Ratio(4_000, 1)), ..degrees };
        assert!(judge(&stated, 16_384, 1).contains("608Fh) is 16384:1, expected 4000:1"));
    }

    #[test]
    fn drive_without_stated_objects_counts_by_the_others() {
        let degrees = angle(36_000, CENTIDEGREE);
        let misfit = degrees.judge(&drive(None, Some(16_384), None)).unwrap_err().to_string();
        assert!(
            misfit.starts_with(
                "position scale (608Fh) is 16384 counts of 6064h per revolution of the motor, expected 36000: correct"
            ),
            "{misfit}"
        );
        assert_eq!(degrees.judge(&drive(None, None, None)), Ok(()), "stated only");
    }
}
