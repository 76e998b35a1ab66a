//! `[[joint]]`, what its drive is meant to hold: polarity, gear, encoder, feed and ratings.
//!
//! The boot compares them with the drive, and changes none of them.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use canopen::nameplate::{Nameplate, Rating, Ratio};
use written::List;

/// Units of 6076h, with how many make 1 N·m.
const UNITS: [(&str, (f64, &str)); 2] = [("mNm", (1e3, "mN·m")), ("uNm", (1e6, "µN·m"))];

/// Reads the expected values; `None` where a problem has been noted.
pub(super) fn read(joint: &raw::Joint, problems: &mut Problems<'_>) -> Option<Nameplate> {
    let counts = Ratio(joint.encoder_counts_per_rev.get()?, 1);
    let unit = joint.rated_torque_unit.or("mNm".to_owned());
    let (scale, unit) = problems.one_of(&unit, &UNITS)?;
    let encoder = ratio(&joint.drive_encoder, problems);
    let gear = ratio(&joint.drive_gear, problems);
    let feed = ratio(&joint.drive_feed, problems);
    let current = problems.within(&joint.rated_current_a, 1e-3..=1e4);
    Some(Nameplate {
        polarity: joint.drive_polarity.or(0).get()?,
        encoder: encoder.map_or_else(|| vec![counts, Ratio::ONE], |given| vec![given]),
        gear: gear.unwrap_or(Ratio::ONE),
        feed: feed.map_or_else(|| vec![Ratio::ONE, counts], |given| vec![given]),
        rated_current: current.map(|amperes| Rating { value: amperes * 1e3, unit: "mA" }),
        modes: joint.drive_modes.get(),
        rated_torque: Rating { value: joint.rated_torque_nm.get()? * scale, unit },
    })
}

fn ratio(value: &Optional<List<u32, 2>>, problems: &mut Problems<'_>) -> Option<Ratio> {
    let List([of, to]) = value.get()?;
    if of == 0 || to == 0 {
        problems.add(value, format_args!("must be two numbers above zero, got {of} and {to}"));
    }
    Some(Ratio(of, to))
}
