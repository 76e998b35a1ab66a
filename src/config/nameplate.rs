//! `[[joint]]`, nameplate of its drive: expected polarity, gear, encoder, feed and ratings.
//!
//! The boot compares them with the drive and writes none of them.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use canopen::eds::Eds;
use canopen::fact::Fact;
use canopen::nameplate::position_scale::{Contradiction, PositionScale};
use canopen::nameplate::units::{SiUnit, Units};
use canopen::nameplate::{Nameplate, Rating, Ratio};
use canopen::object::Object;
use toml_input::List;

/// Units of the rated torque (6076h): name in the file, number per N·m, and symbol.
const UNITS: [(&str, (f64, &str)); 2] = [("mNm", (1e3, "mN·m")), ("uNm", (1e6, "µN·m"))];

/// Relative difference between a feed, a ratio of integers, and the units of an angle.
const FEED_ROUNDING: f64 = 1e-6;

/// Reads the expected values of a drive with this data sheet. Returns `None` after a problem.
pub(super) fn read(
    joint: &raw::Joint,
    eds: Option<&Eds>,
    problems: &mut Problems<'_>,
) -> Option<Nameplate> {
    let unit = joint.rated_torque_unit.or("mNm".to_owned());
    let (millis, torque_unit) = problems.one_of(&unit, &UNITS)?;
    let scale = position_scale(joint, eds, problems)?;
    let current = problems.within(&joint.rated_current_a, 1e-3..=1e4);
    Some(Nameplate {
        polarity: joint.drive_polarity.or(0).get()?,
        scale,
        rated_current: current.map(|amperes| Rating { value: amperes * 1e3, unit: "mA" }),
        modes: joint.drive_modes.get(),
        rated_torque: Rating { value: joint.rated_torque_nm.get()? * millis, unit: torque_unit },
        capacity: None,
        units: Units::default(),
    })
}

/// Reads the position scale. Refuses counts that the stated objects contradict.
fn position_scale(
    joint: &raw::Joint,
    eds: Option<&Eds>,
    problems: &mut Problems<'_>,
) -> Option<PositionScale> {
    let before = problems.count();
    let scale = PositionScale {
        counts: joint.encoder_counts_per_rev.get()?,
        unit: SiUnit(joint.drive_position_unit.or(SiUnit::INCREMENTS.0).get()?),
        encoder: ratio(&joint.drive_encoder, problems),
        gear: ratio(&joint.drive_gear, problems).unwrap_or(Ratio::ONE),
        feed: ratio(&joint.drive_feed, problems),
    };
    if let (Some(eds), true) = (eds, problems.count() == before)
        && let Err(contradiction) = scale.check(|object| eds.object(object).is_some())
    {
        problems.add(&joint.encoder_counts_per_rev, contradicted(&scale, &contradiction));
    }
    check_feed(&scale, joint, problems);
    Some(scale)
}

/// Returns the reason against the configured counts: `must be 36000, as 6064h counts … per revolution of the motor`.
fn contradicted(scale: &PositionScale, contradiction: &Contradiction) -> String {
    let by = match contradiction.by {
        Object::POSITION_UNIT => format!("drive_position_unit {}", scale.unit),
        Object::FEED => format!("drive_feed {}", scale.feed.unwrap_or(Ratio::ONE)),
        _ => {
            let encoder = scale.encoder.unwrap_or(Ratio::ONE);
            format!("drive_encoder {encoder}, as the data sheet has no 6092h")
        }
    };
    let must = match contradiction.nearest() {
        Some(counts) => format!("must be {counts}"),
        None => format!("no integer is within 0.1 % of {:.3e}", contradiction.counts),
    };
    let (gear, got) = (scale.gear, scale.counts);
    format!(
        "{must}, the counts of 6064h per revolution of the motor by drive_gear {gear} and {by}; got {got}"
    )
}

/// Refuses a feed other than the units of an angle in a revolution of the shaft; 1:1 is unused.
fn check_feed(scale: &PositionScale, joint: &raw::Joint, problems: &mut Problems<'_>) {
    let Some((feed, units)) = scale.feed.zip(scale.unit.per_revolution()) else { return };
    if feed != Ratio::ONE && (feed.value() - units).abs() > FEED_ROUNDING * units {
        let unit = scale.unit;
        let reason = format!(
            "must be 1:1 or {units}:1, as drive_position_unit {unit} has {units} units in a revolution; got {feed}"
        );
        problems.add(&joint.drive_feed, reason);
    }
}

/// Reads `accept_stated_only`: facts that are accepted without verification by an object of the drive.
pub(super) fn accepted(joint: &raw::Joint, problems: &mut Problems<'_>) -> Vec<Fact> {
    let given = joint.accept_stated_only.as_ref().map(Vec::as_slice).unwrap_or_default();
    let mut accepted = Vec::new();
    for name in given {
        match Fact::ALL.into_iter().find(|fact| fact.key() == name) {
            Some(fact) => accepted.push(fact),
            None => {
                let [first, second, third] = Fact::ALL.map(Fact::key);
                let name = name.escape_debug();
                let reason = format!(
                    "unknown fact \"{name}\"; expected \"{first}\", \"{second}\" or \"{third}\""
                );
                problems.add(&joint.accept_stated_only, reason);
            }
        }
    }
    accepted
}

fn ratio(value: &Optional<List<u32, 2>>, problems: &mut Problems<'_>) -> Option<Ratio> {
    let List([of, to]) = value.get()?;
    if of == 0 || to == 0 {
        problems.add(value, format_args!("must be two numbers above zero, got {of} and {to}"));
    }
    Some(Ratio(of, to))
}
