//! Settings of the [operator model](crate::operator_model): presets, and a scenario's `[hand]`.
//!
//! The values are of the order measured on human subjects:
//!
//! - The hand of an arm held still: 50 to 800 N/m and 5 to 50 N·s/m, more with the grip's force
//!   (Mussa-Ivaldi, Hogan and Bizzi 1985; Tsuji et al. 1995; Hasser and Cutkosky 2002).
//! - The wrist: some N·m/rad when passive (Formica et al. 2012), several times that when tense.
//! - Reaction time to a push: 0.12 to 0.25 s; the faster reflexes are part of the
//!   impedance (Pruszynski and Scott 2012).
//! - Physiological tremor: 6 to 12 Hz (Deuschl et al. 1998), about 0.1 mm at rest (Harwell and Ferguson
//!   1983), several times that when enhanced by stress.

use std::ops::RangeInclusive;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

use crate::hand::Hand;
use crate::tremor::Shake;
use toml_input::List;

/// Impedance, reaction and tremor of an operator.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "Table", into = "Table")]
pub struct OperatorSettings {
    /// Impedance without load.
    pub(super) hand: Hand,
    /// Reaction time to script and wrench, in s.
    pub(super) reaction: f64,
    /// Yielding, as a fraction of the deflection of the hand's spring.
    pub(super) yielding: f64,
    /// Relative increase of stiffness at the maximum force.
    pub(super) stiffening: f64,
    /// Force change that makes the operator let go, in N.
    pub(super) startle: Option<f64>,
    /// Amplitude and frequencies of the tremor.
    pub(super) shake: Shake,
}

/// Reasons to refuse a `[hand]`.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum InvalidOperatorSettings {
    /// Value out of its range, or not a number.
    #[error("{key} must be within {}..={}, got {value}", range.start(), range.end())]
    Number {
        /// Key in `[hand]`.
        key: &'static str,
        /// Value given.
        value: f64,
        /// Range allowed.
        range: RangeInclusive<f64>,
    },
    /// Lower frequency of the tremor above the upper one.
    #[error("tremor_hz must ascend, got [{0}, {1}]")]
    Band(f64, f64),
}

impl OperatorSettings {
    /// No reaction time, no reaction to forces. The default.
    pub const STEADY: Self = Self {
        hand: Hand::FIRM_NOT_STIFF,
        reaction: 0.0,
        yielding: 0.0,
        stiffening: 0.0,
        startle: None,
        shake: Shake { amplitude: 0.2e-3, band: [6.0, 12.0] },
    };

    /// Low stiffness, slow, yields to forces.
    pub const RELAXED: Self = Self {
        hand: Hand {
            stiffness: 150.0,
            damping: 8.0,
            rotational_stiffness: 2.0,
            rotational_damping: 0.06,
            max_force: 15.0,
            max_moment: 0.8,
        },
        reaction: 0.22,
        yielding: 0.4,
        stiffening: 0.0,
        startle: None,
        shake: Shake { amplitude: 0.1e-3, band: [6.0, 10.0] },
    };

    /// High stiffness, which rises with the force.
    pub const FIRM: Self = Self {
        hand: Hand {
            stiffness: 800.0,
            damping: 30.0,
            rotational_stiffness: 10.0,
            rotational_damping: 0.2,
            max_force: 60.0,
            max_moment: 3.0,
        },
        reaction: 0.18,
        yielding: 0.0,
        stiffening: 0.5,
        startle: None,
        shake: Shake { amplitude: 0.2e-3, band: [6.0, 12.0] },
    };

    /// High stiffness, fast, strong tremor; lets go at a jerk.
    pub const NERVOUS: Self = Self {
        hand: Hand {
            stiffness: 600.0,
            damping: 12.0,
            rotational_stiffness: 8.0,
            rotational_damping: 0.1,
            max_force: 40.0,
            max_moment: 2.0,
        },
        reaction: 0.15,
        yielding: 0.0,
        stiffening: 1.0,
        startle: Some(15.0),
        shake: Shake { amplitude: 0.5e-3, band: [8.0, 12.0] },
    };

    /// Returns the same hand without its tremor.
    #[must_use]
    pub const fn without_tremor(self) -> Self {
        Self { shake: Shake { amplitude: 0.0, ..self.shake }, ..self }
    }

    /// Returns the deflection of the hand's spring, in m, at a force of `force` N: the lead of the script over the hand.
    pub fn deflection(&self, force: f64) -> f64 {
        let stiffened = 1.0 + self.stiffening * (force / self.hand.max_force).min(1.0);
        force / (self.hand.stiffness * stiffened) + self.yielding * force / self.hand.stiffness
    }

    /// Returns the rotational deflection of the hand's spring, in rad, at a moment of `moment` N·m.
    pub fn turn_deflection(&self, moment: f64) -> f64 {
        (1.0 + self.yielding) * moment / self.hand.rotational_stiffness
    }
}

impl Default for OperatorSettings {
    fn default() -> Self {
        Self::STEADY
    }
}

/// Names of the presets.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
enum Preset {
    #[default]
    Steady,
    Relaxed,
    Firm,
    Nervous,
}

impl Preset {
    const fn settings(self) -> OperatorSettings {
        match self {
            Self::Steady => OperatorSettings::STEADY,
            Self::Relaxed => OperatorSettings::RELAXED,
            Self::Firm => OperatorSettings::FIRM,
            Self::Nervous => OperatorSettings::NERVOUS,
        }
    }
}

/// `[hand]`: a preset, and values that replace those of the preset.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
struct Table {
    preset: Preset,
    #[serde(skip_serializing, rename = "temperament", deserialize_with = "refuse_former_key")]
    _former_preset: (),
    stiffness_n_per_m: Option<f64>,
    damping_ns_per_m: Option<f64>,
    stiffness_nm_per_rad: Option<f64>,
    damping_nms_per_rad: Option<f64>,
    max_force_n: Option<f64>,
    max_moment_nm: Option<f64>,
    reaction_s: Option<f64>,
    yielding: Option<f64>,
    stiffening: Option<f64>,
    startle_n: Option<f64>,
    tremor_mm: Option<f64>,
    tremor_hz: Option<List<f64, 2>>,
}

impl TryFrom<Table> for OperatorSettings {
    type Error = InvalidOperatorSettings;

    fn try_from(table: Table) -> Result<Self, InvalidOperatorSettings> {
        let preset = table.preset.settings();
        let millimetres = |metres: f64| 1e3 * metres;
        let Hand {
            stiffness,
            damping,
            rotational_stiffness,
            rotational_damping,
            max_force,
            max_moment,
        } = preset.hand;
        let hand = Hand {
            stiffness: within("stiffness_n_per_m", table.stiffness_n_per_m, stiffness, 1.0..=5e3)?,
            damping: within("damping_ns_per_m", table.damping_ns_per_m, damping, 0.0..=500.0)?,
            rotational_stiffness: within(
                "stiffness_nm_per_rad",
                table.stiffness_nm_per_rad,
                rotational_stiffness,
                0.01..=100.0,
            )?,
            rotational_damping: within(
                "damping_nms_per_rad",
                table.damping_nms_per_rad,
                rotational_damping,
                0.0..=10.0,
            )?,
            max_force: within("max_force_n", table.max_force_n, max_force, 0.1..=500.0)?,
            max_moment: within("max_moment_nm", table.max_moment_nm, max_moment, 0.01..=50.0)?,
        };
        let startle = table.startle_n.or(preset.startle);
        let amplitude = millimetres(preset.shake.amplitude);
        let amplitude = within("tremor_mm", table.tremor_mm, amplitude, 0.0..=5.0)? / 1e3;
        let tremor_hz = table.tremor_hz.map_or(preset.shake.band, |list| list.0);
        let shake = Shake { amplitude, band: band(tremor_hz)? };
        Ok(Self {
            hand,
            reaction: within("reaction_s", table.reaction_s, preset.reaction, 0.0..=0.5)?,
            yielding: within("yielding", table.yielding, preset.yielding, 0.0..=0.9)?,
            stiffening: within("stiffening", table.stiffening, preset.stiffening, 0.0..=4.0)?,
            startle: startle.map(|force| checked("startle_n", force, 0.1..=500.0)).transpose()?,
            shake,
        })
    }
}

/// Every number, so that the preset does not matter.
impl From<OperatorSettings> for Table {
    fn from(settings: OperatorSettings) -> Self {
        let OperatorSettings { hand, reaction, yielding, stiffening, startle, shake } = settings;
        Self {
            preset: Preset::default(),
            _former_preset: (),
            stiffness_n_per_m: Some(hand.stiffness),
            damping_ns_per_m: Some(hand.damping),
            stiffness_nm_per_rad: Some(hand.rotational_stiffness),
            damping_nms_per_rad: Some(hand.rotational_damping),
            max_force_n: Some(hand.max_force),
            max_moment_nm: Some(hand.max_moment),
            reaction_s: Some(reaction),
            yielding: Some(yielding),
            stiffening: Some(stiffening),
            startle_n: startle,
            tremor_mm: Some(1e3 * shake.amplitude),
            tremor_hz: Some(List(shake.band)),
        }
    }
}

/// Checks the lower and upper frequency of a tremor, in Hz.
fn band([slowest, fastest]: [f64; 2]) -> Result<[f64; 2], InvalidOperatorSettings> {
    let slowest = checked("tremor_hz", slowest, 1.0..=20.0)?;
    let fastest = checked("tremor_hz", fastest, 1.0..=20.0)?;
    let is_band = slowest <= fastest;
    if is_band {
        Ok([slowest, fastest])
    } else {
        Err(InvalidOperatorSettings::Band(slowest, fastest))
    }
}

/// Returns the value in the file after a range check, else that of the preset.
fn within(
    key: &'static str,
    written: Option<f64>,
    preset: f64,
    range: RangeInclusive<f64>,
) -> Result<f64, InvalidOperatorSettings> {
    written.map_or(Ok(preset), |value| checked(key, value, range))
}

fn checked(
    key: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
) -> Result<f64, InvalidOperatorSettings> {
    let is_within = range.contains(&value);
    if is_within { Ok(value) } else { Err(InvalidOperatorSettings::Number { key, value, range }) }
}

fn refuse_former_key<'de, D: Deserializer<'de>>(_: D) -> Result<(), D::Error> {
    Err(D::Error::custom("key `temperament` was renamed to `preset`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<OperatorSettings, String> {
        toml::from_str(text).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn empty_table_is_the_steady_preset() {
        assert_eq!(read("").unwrap(), OperatorSettings::STEADY);
        assert_eq!(OperatorSettings::default().hand, Hand::default());
    }

    #[test]
    fn presets_differ_as_their_names_say() {
        let names = ["steady", "relaxed", "firm", "nervous"];
        let read = names.map(|name| read(&format!("preset = \"{name}\"")).unwrap());
        let [steady, relaxed, firm, nervous] = read;
        assert!(relaxed.hand.stiffness < steady.hand.stiffness);
        assert!(steady.hand.stiffness < firm.hand.stiffness);
        assert!(nervous.shake.amplitude > firm.shake.amplitude && nervous.startle.is_some());
    }

    #[test]
    fn values_replace_those_of_the_preset() {
        let text = "preset = \"firm\"\nstiffness_n_per_m = 300\ntremor_mm = 0.4\nstartle_n = 9";
        let firm = OperatorSettings::FIRM;
        let read = read(text).unwrap();
        assert_eq!(read.hand, Hand { stiffness: 300.0, ..firm.hand });
        assert!((read.shake.amplitude - 0.4e-3).abs() < 1e-12);
        assert_eq!((read.reaction, read.startle), (firm.reaction, Some(9.0)));
    }

    #[test]
    fn invalid_values_are_refused_with_their_key() {
        for (text, reason) in [
            ("stiffness_n_per_m = 0", "stiffness_n_per_m must be within 1..=5000, got 0"),
            ("reaction_s = 0.6", "reaction_s must be within 0..=0.5, got 0.6"),
            ("yielding = 1.0", "yielding must be within 0..=0.9, got 1"),
            ("tremor_mm = nan", "tremor_mm must be within 0..=5, got NaN"),
            ("startle_n = -1", "startle_n must be within 0.1..=500, got -1"),
            ("tremor_hz = [9, 8]", "tremor_hz must ascend, got [9, 8]"),
            ("tremor_hz = [0, 8]", "tremor_hz must be within 1..=20, got 0"),
            ("preset = \"shy\"", "unknown variant `shy`"),
            ("temperament = \"firm\"", "key `temperament` was renamed to `preset`"),
            ("stiffness = 3", "unknown field `stiffness`"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.starts_with(reason), "{error}");
        }
    }
}
