//! Temperaments: what kind of hand holds the grip, as numbers, by name or from a scenario's `[hand]`.
//!
//! What a hand does with them is told in [`person`](crate::person). The figures are of the order
//! that is measured; they are no one person's.
//!
//! - The hand of an arm held still: 50 to 800 N/m and 5 to 50 N·s/m, more with the grip's force
//!   (Mussa-Ivaldi, Hogan and Bizzi 1985; Tsuji et al. 1995; Hasser and Cutkosky 2002).
//! - The wrist: some N·m/rad when passive (Formica et al. 2012), several times that when tensed.
//! - From a push to a voluntary answer: 0.12 to 0.25 s; reflexes, which are earlier, are part of the
//!   impedance (Pruszynski and Scott 2012).
//! - Physiological tremor: 6 to 12 Hz (Deuschl et al. 1998), about 0.1 mm at rest (Harwell and Ferguson
//!   1983), several times that when enhanced by stress.

use std::ops::RangeInclusive;

use serde::Deserialize;
use thiserror::Error;

use crate::hand::Hand;
use crate::tremor::Shake;
use written::List;

/// How a hand holds, and how it answers.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Table")]
pub struct Temperament {
    /// Its impedance while it feels nothing.
    pub(super) hand: Hand,
    /// How late it follows what is meant and answers what it feels, in s.
    pub(super) reaction: f64,
    /// By what share of its spring's deflection it gives way.
    pub(super) yielding: f64,
    /// By what share it is stiffer when it feels its largest pull.
    pub(super) stiffening: f64,
    /// A felt force that differs so much from what it has got used to lets it let go, in N.
    pub(super) startle: Option<f64>,
    /// How it shakes.
    pub(super) shake: Shake,
}

/// Why a `[hand]` is none.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum InvalidTemperament {
    /// A number beyond its bounds, or none.
    #[error("{key} = {value} is not within {} and {}", range.start(), range.end())]
    Number {
        /// Where it stands.
        key: &'static str,
        /// What stands there.
        value: f64,
        /// What may.
        range: RangeInclusive<f64>,
    },
    /// The band of a tremor begins above its end.
    #[error("tremor_hz = [{0}, {1}] ends before it begins")]
    Band(f64, f64),
}

impl Temperament {
    /// Follows its script at once and answers nothing: the hand of a scenario that names none.
    pub const STEADY: Self = Self {
        hand: Hand::FIRM_NOT_STIFF,
        reaction: 0.0,
        yielding: 0.0,
        stiffening: 0.0,
        startle: None,
        shake: Shake { amplitude: 0.2e-3, band: [6.0, 12.0] },
    };

    /// Holds lightly, is in no hurry, and gives way to what pushes it.
    pub const RELAXED: Self = Self {
        hand: Hand {
            stiffness: 150.0,
            damping: 8.0,
            turning_stiffness: 2.0,
            turning_damping: 0.06,
            max_force: 15.0,
            max_moment: 0.8,
        },
        reaction: 0.22,
        yielding: 0.4,
        stiffening: 0.0,
        startle: None,
        shake: Shake { amplitude: 0.1e-3, band: [6.0, 10.0] },
    };

    /// Holds tight, and tighter against what pushes it.
    pub const FIRM: Self = Self {
        hand: Hand {
            stiffness: 800.0,
            damping: 30.0,
            turning_stiffness: 10.0,
            turning_damping: 0.2,
            max_force: 60.0,
            max_moment: 3.0,
        },
        reaction: 0.18,
        yielding: 0.0,
        stiffening: 0.5,
        startle: None,
        shake: Shake { amplitude: 0.2e-3, band: [6.0, 12.0] },
    };

    /// Tense, quick, shaking, and gone when something jerks at it.
    pub const NERVOUS: Self = Self {
        hand: Hand {
            stiffness: 600.0,
            damping: 12.0,
            turning_stiffness: 8.0,
            turning_damping: 0.1,
            max_force: 40.0,
            max_moment: 2.0,
        },
        reaction: 0.15,
        yielding: 0.0,
        stiffening: 1.0,
        startle: Some(15.0),
        shake: Shake { amplitude: 0.5e-3, band: [8.0, 12.0] },
    };
}

impl Default for Temperament {
    fn default() -> Self {
        Self::STEADY
    }
}

/// The names a scenario calls them by.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Name {
    #[default]
    Steady,
    Relaxed,
    Firm,
    Nervous,
}

impl Name {
    const fn temperament(self) -> Temperament {
        match self {
            Self::Steady => Temperament::STEADY,
            Self::Relaxed => Temperament::RELAXED,
            Self::Firm => Temperament::FIRM,
            Self::Nervous => Temperament::NERVOUS,
        }
    }
}

/// `[hand]` as it is written: a temperament, and what is otherwise than with it.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Table {
    temperament: Name,
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

impl TryFrom<Table> for Temperament {
    type Error = InvalidTemperament;

    fn try_from(table: Table) -> Result<Self, InvalidTemperament> {
        let named = table.temperament.temperament();
        let millimetres = |metres: f64| 1e3 * metres;
        let Hand { stiffness, damping, turning_stiffness, turning_damping, max_force, max_moment } =
            named.hand;
        let hand = Hand {
            stiffness: within("stiffness_n_per_m", table.stiffness_n_per_m, stiffness, 1.0..=5e3)?,
            damping: within("damping_ns_per_m", table.damping_ns_per_m, damping, 0.0..=500.0)?,
            turning_stiffness: within(
                "stiffness_nm_per_rad",
                table.stiffness_nm_per_rad,
                turning_stiffness,
                0.01..=100.0,
            )?,
            turning_damping: within(
                "damping_nms_per_rad",
                table.damping_nms_per_rad,
                turning_damping,
                0.0..=10.0,
            )?,
            max_force: within("max_force_n", table.max_force_n, max_force, 0.1..=500.0)?,
            max_moment: within("max_moment_nm", table.max_moment_nm, max_moment, 0.01..=50.0)?,
        };
        let startle = table.startle_n.or(named.startle);
        let amplitude = millimetres(named.shake.amplitude);
        let amplitude = within("tremor_mm", table.tremor_mm, amplitude, 0.0..=5.0)? / 1e3;
        let tremor_hz = table.tremor_hz.map_or(named.shake.band, |list| list.0);
        let shake = Shake { amplitude, band: band(tremor_hz)? };
        Ok(Self {
            hand,
            reaction: within("reaction_s", table.reaction_s, named.reaction, 0.0..=0.5)?,
            yielding: within("yielding", table.yielding, named.yielding, 0.0..=0.9)?,
            stiffening: within("stiffening", table.stiffening, named.stiffening, 0.0..=4.0)?,
            startle: startle.map(|force| checked("startle_n", force, 0.1..=500.0)).transpose()?,
            shake,
        })
    }
}

/// The slowest and the fastest of a tremor, in Hz.
fn band([slowest, fastest]: [f64; 2]) -> Result<[f64; 2], InvalidTemperament> {
    let slowest = checked("tremor_hz", slowest, 1.0..=20.0)?;
    let fastest = checked("tremor_hz", fastest, 1.0..=20.0)?;
    let is_band = slowest <= fastest;
    if is_band { Ok([slowest, fastest]) } else { Err(InvalidTemperament::Band(slowest, fastest)) }
}

/// What is written, if it may be; else what is named.
fn within(
    key: &'static str,
    written: Option<f64>,
    named: f64,
    range: RangeInclusive<f64>,
) -> Result<f64, InvalidTemperament> {
    written.map_or(Ok(named), |value| checked(key, value, range))
}

fn checked(
    key: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
) -> Result<f64, InvalidTemperament> {
    let is_within = range.contains(&value);
    if is_within { Ok(value) } else { Err(InvalidTemperament::Number { key, value, range }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Temperament, String> {
        toml::from_str(text).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn a_table_that_says_nothing_is_the_steady_hand() {
        assert_eq!(read("").unwrap(), Temperament::STEADY);
        assert_eq!(Temperament::default().hand, Hand::default());
    }

    #[test]
    fn each_temperament_has_its_name_and_differs_from_the_others() {
        let names = ["steady", "relaxed", "firm", "nervous"];
        let read = names.map(|name| read(&format!("temperament = \"{name}\"")).unwrap());
        let [steady, relaxed, firm, nervous] = read;
        assert!(relaxed.hand.stiffness < steady.hand.stiffness);
        assert!(steady.hand.stiffness < firm.hand.stiffness);
        assert!(nervous.shake.amplitude > firm.shake.amplitude && nervous.startle.is_some());
    }

    #[test]
    fn what_is_written_goes_before_what_is_named_and_the_rest_stays() {
        let text =
            "temperament = \"firm\"\nstiffness_n_per_m = 300\ntremor_mm = 0.4\nstartle_n = 9";
        let firm = Temperament::FIRM;
        let read = read(text).unwrap();
        assert_eq!(read.hand, Hand { stiffness: 300.0, ..firm.hand });
        assert!((read.shake.amplitude - 0.4e-3).abs() < 1e-12);
        assert_eq!((read.reaction, read.startle), (firm.reaction, Some(9.0)));
    }

    #[test]
    fn a_hand_that_is_none_is_refused_by_its_key() {
        for (text, reason) in [
            ("stiffness_n_per_m = 0", "stiffness_n_per_m = 0 is not within 1 and 5000"),
            ("reaction_s = 0.6", "reaction_s = 0.6 is not within 0 and 0.5"),
            ("yielding = 1.0", "yielding = 1 is not within 0 and 0.9"),
            ("tremor_mm = nan", "tremor_mm = NaN is not within 0 and 5"),
            ("startle_n = -1", "startle_n = -1 is not within 0.1 and 500"),
            ("tremor_hz = [9, 8]", "tremor_hz = [9, 8] ends before it begins"),
            ("tremor_hz = [0, 8]", "tremor_hz = 0 is not within 1 and 20"),
            ("temperament = \"shy\"", "unknown variant `shy`"),
            ("stiffness = 3", "unknown field `stiffness`"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.starts_with(reason), "{error}");
        }
    }
}
