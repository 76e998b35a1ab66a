//! `[[joint]]`, nameplate of its drive: expected polarity, gear, encoder, feed and ratings.
//!
//! The boot compares them with the drive and writes none of them.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use canopen::fact::Fact;
use canopen::nameplate::units::{SiUnit, Units};
use canopen::nameplate::{Nameplate, Rating, Ratio};
use toml_input::List;

/// Units of the rated torque (6076h): name in the file, number per N·m, and symbol.
const UNITS: [(&str, (f64, &str)); 2] = [("mNm", (1e3, "mN·m")), ("uNm", (1e6, "µN·m"))];

/// Reads the expected values. Returns `None` after a problem.
pub(super) fn read(joint: &raw::Joint, problems: &mut Problems<'_>) -> Option<Nameplate> {
    let counts = joint.encoder_counts_per_rev.get()?;
    let unit = joint.rated_torque_unit.or("mNm".to_owned());
    let (scale, torque_unit) = problems.one_of(&unit, &UNITS)?;
    let encoder = ratio(&joint.drive_encoder, problems);
    let gear = ratio(&joint.drive_gear, problems);
    let feed = ratio(&joint.drive_feed, problems);
    // The key counts 6064h per revolution of the motor; 6092h is per revolution of the shaft behind the gear.
    let shaft = gear.unwrap_or(Ratio::ONE).times(counts).into_iter();
    let unit = joint.drive_position_unit.or(SiUnit::INCREMENTS.0).get()?;
    let current = problems.within(&joint.rated_current_a, 1e-3..=1e4);
    Some(Nameplate {
        polarity: joint.drive_polarity.or(0).get()?,
        encoder: stated(encoder, || shaft.clone().chain([Ratio::ONE]).collect()),
        gear: gear.unwrap_or(Ratio::ONE),
        feed: stated(feed, || [Ratio::ONE].into_iter().chain(shaft.clone()).collect()),
        rated_current: current.map(|amperes| Rating { value: amperes * 1e3, unit: "mA" }),
        modes: joint.drive_modes.get(),
        rated_torque: Rating { value: joint.rated_torque_nm.get()? * scale, unit: torque_unit },
        capacity: None,
        units: Units { position: SiUnit(unit), ..Units::default() },
    })
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

/// Returns the configured value alone, or the default ones.
fn stated(value: Option<Ratio>, usual: impl Fn() -> Vec<Ratio>) -> Vec<Ratio> {
    value.map_or_else(usual, |value| vec![value])
}

fn ratio(value: &Optional<List<u32, 2>>, problems: &mut Problems<'_>) -> Option<Ratio> {
    let List([of, to]) = value.get()?;
    if of == 0 || to == 0 {
        problems.add(value, format_args!("must be two numbers above zero, got {of} and {to}"));
    }
    Some(Ratio(of, to))
}
