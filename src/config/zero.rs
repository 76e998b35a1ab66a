//! `[[joint]] zero`: where the zero of a joint comes from, and how long it is known.
//!
//! | kind          | 6064h after a power cycle               | zero is known                                            |
//! |---------------|-----------------------------------------|----------------------------------------------------------|
//! | `absolute`    | means the same                          | always                                                   |
//! | `single-turn` | is unique within a revolution           | once the rest posture has selected the revolution        |
//! | `rest`        | counts from power-up                    | once a person has said that the arm rests (`ctl zero`)   |
//! | `homing`      | counts from the home that the drive set | once the drive has taken the rest posture for its home   |

use std::time::Duration;

use crate::boot::BootSettings;
use crate::problem::Problems;
use crate::torque_limit::TorqueLimit;
use crate::value::{HasPlace, Optional};
use crate::{lookup, raw, shown_mode};
use canopen::Value;
use canopen::eds::Eds;
use canopen::object::Object;
use canopen::sdo::bytes;

/// Motor revolutions within which 6064h of a single-turn encoder is unique: many pole pairs, or many turns.
const UNIQUE_TURNS: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// Default of the time allowed for homing, in s.
const HOMING_S: f64 = 2.0;

/// Homing methods that take the current position for home, the present number first (CiA 402-2, 11).
const STILL_METHODS: [i8; 2] = [37, 35];

/// Bits of the statusword that CiA 402 leaves to the maker.
const MAKERS_BITS: [u8; 3] = [8, 14, 15];

/// Zero of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zero {
    /// Where the zero comes from.
    pub source: ZeroSource,
    /// Set if the drive keeps 6064h over NMT reset communication (82h), by its manual.
    pub keeps_position_over_82h: bool,
}

/// Source of the zero of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ZeroSource {
    /// 6064h means the same after a power cycle.
    Absolute,
    /// 6064h is unique within a revolution, which the rest posture selects.
    SingleTurn {
        /// Counts within which it is unique.
        counts: f64,
    },
    /// 6064h counts from power-up; a person says when the arm rests.
    Rest,
    /// 6064h counts from the home that the drive has set at rest.
    Homing(Homing),
}

/// Homing without motion, in the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    /// Homing method (6098h): 37 or 35.
    pub method: i8,
    /// Time allowed until the statusword reports that homing is attained.
    pub timeout: Duration,
    /// Bit of the statusword that is set while the drive knows its home, in every mode.
    pub referenced_bit: Option<u8>,
}

impl ZeroSource {
    /// Returns the word of the configuration.
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Absolute => "absolute",
            Self::SingleTurn { .. } => "single-turn",
            Self::Rest => "rest",
            Self::Homing(_) => "homing",
        }
    }

    /// Returns whether a power cycle leaves the zero as it is.
    pub const fn is_absolute(&self) -> bool {
        matches!(self, Self::Absolute)
    }
}

/// Properties of a drive that decide whether it can be homed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive<'a> {
    /// EDS; `None` if it could not be read.
    pub(super) eds: Option<&'a Eds>,
    /// Torque limit in place of 6072h.
    pub(super) limit: Option<&'a TorqueLimit>,
    pub(super) boot: &'a BootSettings,
}

/// Reads the zero of a joint with this drive. Returns `None` after a problem.
pub(super) fn read(
    joint: &raw::Joint,
    drive: Drive<'_>,
    problems: &mut Problems<'_>,
) -> Option<Zero> {
    let kinds = [
        ("absolute", Kind::Absolute),
        ("single-turn", Kind::SingleTurn),
        ("rest", Kind::Rest),
        ("homing", Kind::Homing),
    ];
    if joint.zero.is_absent() && !problems.files().are_recorded() {
        problems.add(
            &joint.zero,
            "missing field `zero`: where the zero of the joint comes from, \"absolute\", \"single-turn\", \"rest\" or \
             \"homing\"; \"absolute\" if 6064h means the same after a power cycle (docs/zero.md)",
        );
        return None;
    }
    let kind = problems.one_of(&joint.zero.or("absolute".to_owned()), &kinds)?;
    misplaced(joint, kind, problems);
    let source = match kind {
        Kind::Absolute => ZeroSource::Absolute,
        Kind::SingleTurn => ZeroSource::SingleTurn { counts: revolution(joint, problems)? },
        Kind::Rest => ZeroSource::Rest,
        Kind::Homing => ZeroSource::Homing(homing(joint, drive, problems)?),
    };
    let keeps_position_over_82h = joint.keeps_position_over_82h.or(false).get()?;
    Some(Zero { source, keeps_position_over_82h })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Absolute,
    SingleTurn,
    Rest,
    Homing,
}

/// Refuses keys that have no meaning for this kind.
fn misplaced(joint: &raw::Joint, kind: Kind, problems: &mut Problems<'_>) {
    let is_homing = kind == Kind::Homing;
    let is_lost = kind != Kind::Absolute;
    let (homing, lost) = ("\"homing\"", "\"single-turn\", \"rest\" or \"homing\"");
    let given = [
        (joint.homing_s.as_ref().is_some(), is_homing, joint.homing_s.place(), homing),
        (joint.homing_method.as_ref().is_some(), is_homing, joint.homing_method.place(), homing),
        (joint.referenced_bit.as_ref().is_some(), is_homing, joint.referenced_bit.place(), homing),
        (
            joint.unique_turns.as_ref().is_some(),
            kind == Kind::SingleTurn,
            joint.unique_turns.place(),
            "\"single-turn\"",
        ),
        (
            joint.keeps_position_over_82h.as_ref().is_some(),
            is_lost,
            joint.keeps_position_over_82h.place(),
            lost,
        ),
        (joint.second_rest_deg.as_ref().is_some(), is_lost, joint.second_rest_deg.place(), lost),
        (joint.second_rest_m.as_ref().is_some(), is_lost, joint.second_rest_m.place(), lost),
    ];
    for (is_given, has_meaning, place, kinds) in given {
        if is_given && !has_meaning {
            problems.add(place, format_args!("has a meaning only with zero = {kinds}"));
        }
    }
}

/// Reads the counts within which 6064h is unique: of one revolution of the motor, or of `unique_turns`.
fn revolution(joint: &raw::Joint, problems: &mut Problems<'_>) -> Option<f64> {
    let turns = match joint.unique_turns.as_ref() {
        Some(_) => problems.within(&joint.unique_turns, UNIQUE_TURNS)?,
        None => 1.0,
    };
    Some(f64::from(joint.encoder_counts_per_rev.get()?) * turns)
}

/// Reads method, time and bit of a homing. Refuses methods that move, and a drive that cannot be homed.
fn homing(joint: &raw::Joint, drive: Drive<'_>, problems: &mut Problems<'_>) -> Option<Homing> {
    let method = joint.homing_method.or(STILL_METHODS[0]).get()?;
    if !STILL_METHODS.contains(&method) {
        problems.add(
            &joint.homing_method,
            format_args!(
                "must be 37 or 35, which take the current position for home, got {method}: for a method that moves, home with \
                 the maker's tool, hands off the grip"
            ),
        );
    }
    let described = drive.eds.and_then(|eds| eds.object(Object::HOMING_METHOD));
    let number = lookup::node_id(&joint.node_id, problems);
    if let Some((described, node)) = described.zip(number)
        && let Err(outside) = described.check_content(&bytes(&Value::Integer8(method)), node)
    {
        let other = STILL_METHODS.into_iter().find(|other| *other != method).unwrap_or(method);
        problems.add(
            &joint.homing_method,
            format_args!("{outside}: homing_method = {other} does the same in other drives"),
        );
    }
    let lacks = |object| {
        let of = |eds: &Eds| eds.object(object).is_some_and(|it| it.access.is_writable());
        drive.eds.is_some_and(|eds| !of(eds))
    };
    let reason = if lacks(Object::HOMING_METHOD) {
        "\"homing\" requires 6098h in the data sheet, writable"
    } else if !shown_mode::has_reducible_limit(drive.limit, drive.eds) {
        "\"homing\" requires a torque limit that can be reduced to 5 %: 6072h in the EDS, or an object of [joint.torque_limit]"
    } else if drive.boot.shows_mode_when_enabled {
        "\"homing\" requires a drive that shows its mode before it is enabled (boot.mode_shown)"
    } else {
        ""
    };
    if !reason.is_empty() {
        problems.add(&joint.zero, format_args!("{reason}; \"rest\" needs no object of the drive"));
    }
    let timeout = match joint.homing_s.as_ref() {
        Some(_) => problems.within(&joint.homing_s, 0.05..=60.0)?,
        None => HOMING_S,
    };
    Some(Homing {
        method,
        timeout: Duration::from_secs_f64(timeout),
        referenced_bit: referenced_bit(&joint.referenced_bit, problems),
    })
}

fn referenced_bit(given: &Optional<u8>, problems: &mut Problems<'_>) -> Option<u8> {
    let bit = given.get()?;
    if !MAKERS_BITS.contains(&bit) {
        problems.add(
            given,
            format_args!("must be 8, 14 or 15, a bit of 6041h of the maker, got {bit}"),
        );
    }
    Some(bit)
}

/// Reads `zero_counts`: absent with "rest", and within a revolution with "single-turn". Returns `None` after a problem.
pub(super) fn counts(
    joint: &raw::Joint,
    source: ZeroSource,
    problems: &mut Problems<'_>,
) -> Option<i32> {
    let given = &joint.zero_counts;
    if source == ZeroSource::Rest {
        if given.as_ref().is_some() {
            problems.add(
                given,
                "must be absent with zero = \"rest\": `frhc ctl zero` sets the counts by rest_deg (rest_m)",
            );
        }
        return Some(0);
    }
    if given.is_absent() {
        problems.add(given, "missing field `zero_counts`");
        return None;
    }
    let counts = given.get()?;
    if let ZeroSource::SingleTurn { counts: revolution } = source
        && !(0.0..revolution).contains(&f64::from(counts))
    {
        let reason = format!(
            "must be the reading within a revolution with zero = \"single-turn\", 0 to below {revolution:.0}, got {counts}"
        );
        problems.add(given, reason);
    }
    Some(counts)
}
