//! `[controller.scale]`: bounds of the scales that the operator sets while running. `gain_check` checks them.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use controller::adjustment::Bounds;
use controller::scaling::Scale;
use toml_input::List;

/// Maximum scale.
const MAX_SCALE: f64 = 10.0;

/// Default bounds, which never raise a configured gain.
const DEFAULT: [Scale; 2] = [Scale { motion: 0.1, rotation: 0.1, force: 0.0 }, Scale::ONE];

/// Reads the section, with defaults for absent keys, for axes without accommodation. Returns `None` after a problem.
pub(super) fn bounds(raw: &raw::Controller, problems: &mut Problems<'_>) -> Option<Bounds> {
    let [least, most] = DEFAULT;
    let mut range = |given: &Optional<List<f64, 2>>, least: f64, most: f64| {
        let range = given.or(List([least, most]));
        let List([low, high]) = range.get()?;
        if (0.0..=1.0).contains(&low) && (1.0..=MAX_SCALE).contains(&high) {
            return Some([low, high]);
        }
        let reason = format_args!(
            "must be [low, high] with low within 0..=1 and high within 1..={MAX_SCALE}, got [{low}, {high}]"
        );
        problems.add(given, reason);
        None
    };
    let motion = range(&raw.scale.motion, least.motion, most.motion);
    let rotation = range(&raw.scale.rotation, least.rotation, most.rotation);
    let force = range(&raw.scale.force, least.force, most.force);
    let ([motion_low, motion_high], [rotation_low, rotation_high]) = (motion?, rotation?);
    let [force_low, force_high] = force?;
    let low = Scale { motion: motion_low, rotation: rotation_low, force: force_low };
    let high = Scale { motion: motion_high, rotation: rotation_high, force: force_high };
    Some(Bounds { scale: [low, high], ..Bounds::FIXED })
}
