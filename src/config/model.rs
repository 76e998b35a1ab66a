//! `model_limit_*` of `[remote.link]`: maximum difference between model and robot.

use std::ops::RangeInclusive;
use std::time::Duration;

use crate::figure::{optional, required};
use crate::problem::Problems;
use crate::raw;
use crate::remote::is_both;
use ::remote::model::Difference;
use robot::object::Servo;

/// Range of the distance, in m.
const LIMIT_M: RangeInclusive<f64> = 1e-4..=1.0;

/// Range of the angle, in degrees.
const LIMIT_DEG: RangeInclusive<f64> = 0.01..=90.0;

/// End of the message for a missing limit.
const NEEDED: &str = "a model needs: beyond it the robot does not follow, and the object is held";

/// Reads both keys, which `kind = "both"` requires. Returns the outer `None` after a problem, the inner one if no model
/// is configured.
pub(super) fn limit(file: &raw::File, problems: &mut Problems<'_>) -> Option<Option<Difference>> {
    let raw = &file.remote.link;
    let distance = optional(&raw.model_limit_m, LIMIT_M, problems);
    let angle = optional(&raw.model_limit_deg, LIMIT_DEG, problems);
    let is_described = distance != Some(None) || angle != Some(None);
    if !is_both(&file.remote) && !is_described {
        return Some(None);
    }
    let distance = required(&raw.model_limit_m, "model_limit_m", NEEDED, distance, problems);
    let angle = required(&raw.model_limit_deg, "model_limit_deg", NEEDED, angle, problems);
    Some(Some(Difference { distance: distance?, angle: angle?.to_radians() }))
}

/// Refuses a limit below the distance or angle that the robot covers in a round trip at full speed: lost commands alone
/// could exceed it.
pub(super) fn check(
    limit: Option<&Difference>,
    servo: &Servo,
    round_trip: Duration,
    raw: &raw::RemoteLink,
    problems: &mut Problems<'_>,
) {
    let Some(Difference { distance, angle }) = limit else { return };
    let [least, least_angle] = servo.max_speeds().map(|speed| speed * round_trip.as_secs_f64());
    if *distance < least {
        let reason = format_args!(
            "must be at least {least:.4}, the way at max_speed_m_per_s in round_trip_ms: commands that are lost within \
             it would reach the limit"
        );
        problems.add(&raw.model_limit_m, reason);
    }
    if *angle < least_angle {
        let reason = format_args!(
            "must be at least {:.2}, the angle at max_turn_rad_per_s in round_trip_ms: commands that are lost within it \
             would reach the limit",
            least_angle.to_degrees()
        );
        problems.add(&raw.model_limit_deg, reason);
    }
}
