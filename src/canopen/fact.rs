//! Facts that turn samples into angles and torques into set-points. Each is verified by an object of the drive that the
//! boot compares, or stated by the configuration alone.
//!
//! | fact           | verified by                                                        |
//! |----------------|--------------------------------------------------------------------|
//! | sign           | 607Eh                                                              |
//! | position scale | the objects that [`position_scale`](crate::nameplate::position_scale) names |
//! | torque unit    | 6076h, or 6075h where the rated current is configured              |

use std::fmt;

use derive_more::Display;

use crate::nameplate::position_scale::PositionScale;
use crate::nameplate::{Nameplate, StoredValue};
use crate::object::Object;

/// Property of a drive that gives its samples or set-points their meaning.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Fact {
    /// Direction in which 6064h counts.
    #[display("sign")]
    Sign,
    /// Counts of 6064h per revolution.
    #[display("position scale")]
    PositionScale,
    /// Torque of 1000 ‰ in 6071h.
    #[display("torque unit")]
    TorqueUnit,
}

impl Fact {
    /// All facts, in the order of reports.
    pub const ALL: [Self; 3] = [Self::Sign, Self::PositionScale, Self::TorqueUnit];

    /// Returns the name of the fact in a configuration.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Sign => "sign",
            Self::PositionScale => "position_scale",
            Self::TorqueUnit => "torque_unit",
        }
    }

    /// Returns the objects that would verify the fact.
    pub const fn objects(self) -> &'static str {
        match self {
            Self::Sign => "607Eh",
            Self::PositionScale => {
                "6091h, with 608Fh and 6092h other than 1:1 or an angle in 60A8h"
            }
            Self::TorqueUnit => "6076h, or 6075h with rated_current_a",
        }
    }
}

/// Objects of a drive that verify a fact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evidence(&'static [Object]);

/// `608Fh and 6091h`
impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, object) in self.0.iter().enumerate() {
            let and = match place {
                0 => "",
                _ if place + 1 == self.0.len() => " and ",
                _ => ", ",
            };
            write!(f, "{and}{}", Object { sub: 0, ..*object })?;
        }
        Ok(())
    }
}

impl Nameplate {
    /// Returns the evidence for a fact in a drive with these objects; `None` if the fact is stated only.
    pub fn planned_evidence(&self, fact: Fact, has: impl Fn(Object) -> bool) -> Option<Evidence> {
        self.evidence(fact, &has, self.scale.planned_evidence(&has))
    }

    /// Returns the evidence for a fact in the values that the boot has read; `None` if the fact is stated only.
    pub fn found_evidence(&self, fact: Fact, held: &[StoredValue]) -> Option<Evidence> {
        let has = |object| held.iter().any(|it| it.object == object);
        self.evidence(fact, has, PositionScale::found_evidence(held))
    }

    fn evidence(
        &self,
        fact: Fact,
        has: impl Fn(Object) -> bool,
        scale: &'static [Object],
    ) -> Option<Evidence> {
        let objects: &[Object] = match fact {
            Fact::Sign if has(Object::POLARITY) => &[Object::POLARITY],
            Fact::PositionScale => scale,
            Fact::TorqueUnit if has(Object::RATED_TORQUE) => &[Object::RATED_TORQUE],
            Fact::TorqueUnit if self.rated_current.is_some() && has(Object::RATED_CURRENT) => {
                &[Object::RATED_CURRENT]
            }
            Fact::Sign | Fact::TorqueUnit => &[],
        };
        (!objects.is_empty()).then_some(Evidence(objects))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nameplate::units::SiUnit;
    use crate::nameplate::{Rating, Ratio};

    fn nameplate(rated_current: Option<Rating>) -> Nameplate {
        Nameplate {
            polarity: 0,
            scale: PositionScale {
                counts: 16_384,
                unit: SiUnit::INCREMENTS,
                encoder: None,
                gear: Ratio::ONE,
                feed: None,
            },
            rated_current,
            rated_torque: Rating { value: 176.5, unit: "mN·m" },
            units: crate::nameplate::units::Units::default(),
            modes: None,
            capacity: None,
        }
    }

    fn held(object: Object, value: u32) -> StoredValue {
        StoredValue { object, value, size: 4 }
    }

    #[test]
    fn each_fact_is_verified_by_its_objects_alone() {
        let verified = |has: &[Object]| {
            let evidence =
                |fact| nameplate(None).planned_evidence(fact, |object| has.contains(&object));
            Fact::ALL.map(|fact| evidence(fact).map(|it| it.to_string()))
        };
        let some = |text: &str| Some(text.to_owned());
        assert_eq!(verified(&[]), [None, None, None]);
        assert_eq!(verified(&[Object::POLARITY]), [some("607Eh"), None, None]);
        assert_eq!(verified(&[Object::ENCODER_INCREMENTS]), [None, None, None], "without a gear");
        let scale = [Object::ENCODER_INCREMENTS, Object::GEAR_MOTOR_REVOLUTIONS];
        assert_eq!(verified(&scale), [None, some("608Fh and 6091h"), None]);
        assert_eq!(verified(&[Object::RATED_TORQUE]), [None, None, some("6076h")]);
        assert_eq!(verified(&[Object::RATED_CURRENT]), [None, None, None], "not configured");
        let current = nameplate(Some(Rating { value: 1e3, unit: "mA" }));
        let by_current =
            current.planned_evidence(Fact::TorqueUnit, |object| object == Object::RATED_CURRENT);
        assert_eq!(by_current.map(|it| it.to_string()), some("6075h"));
    }

    #[test]
    fn unused_encoder_resolution_verifies_no_scale() {
        let found = |increments, gear| {
            let mut drive = vec![held(Object::ENCODER_INCREMENTS, increments)];
            drive.push(held(Object::ENCODER_REVOLUTIONS, 1));
            drive.extend(gear);
            nameplate(None).found_evidence(Fact::PositionScale, &drive).is_some()
        };
        let gear = Some(held(Object::GEAR_MOTOR_REVOLUTIONS, 1));
        assert!(found(16_384, gear));
        assert!(!found(1, gear));
        assert!(!found(16_384, None));
        let mut unused = nameplate(None);
        unused.scale.encoder = Some(Ratio::ONE);
        assert_eq!(unused.planned_evidence(Fact::PositionScale, |_| true), None);
    }

    #[test]
    fn position_factor_of_one_verifies_no_scale() {
        let drive = |factor, divisor| {
            [held(Object::POSITION_FACTOR, factor), held(Object::POSITION_FACTOR_DIVISOR, divisor)]
        };
        let plan = nameplate(None);
        // Any other ratio is refused at boot.
        for (factor, divisor) in [(1, 1), (4_096, 4_096), (0, 0)] {
            let found = plan.found_evidence(Fact::PositionScale, &drive(factor, divisor));
            assert_eq!(found, None, "{factor}:{divisor}");
        }
    }
}
