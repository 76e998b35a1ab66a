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
    let counts = joint.encoder_counts_per_rev.get()?;
    let unit = joint.rated_torque_unit.or("mNm".to_owned());
    let (scale, unit) = problems.one_of(&unit, &UNITS)?;
    let encoder = ratio(&joint.drive_encoder, problems);
    let gear = ratio(&joint.drive_gear, problems);
    let feed = ratio(&joint.drive_feed, problems);
    // The key counts 6064h, which is behind the gear: the shaft of 6092h has so many counts per revolution.
    let shaft = gear.unwrap_or(Ratio::ONE).times(counts).into_iter();
    let current = problems.within(&joint.rated_current_a, 1e-3..=1e4);
    Some(Nameplate {
        polarity: joint.drive_polarity.or(0).get()?,
        encoder: stated(encoder, || shaft.clone().chain([Ratio::ONE]).collect()),
        gear: gear.unwrap_or(Ratio::ONE),
        feed: stated(feed, || [Ratio::ONE].into_iter().chain(shaft.clone()).collect()),
        rated_current: current.map(|amperes| Rating { value: amperes * 1e3, unit: "mA" }),
        modes: joint.drive_modes.get(),
        rated_torque: Rating { value: joint.rated_torque_nm.get()? * scale, unit },
    })
}

/// Returns a stated value alone, or the usual ones.
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
