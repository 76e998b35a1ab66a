//! Contact posture at the wall, as `frhc check` reports it.

use config::Config;
use controller::contact_posture::{ContactPosture, OutOfReach, PostureBounds};

/// Logs a warning if the wall is out of reach of the hand, or the object starts in it.
pub fn warn(config: &Config) {
    if is_missed(config) || config.wall_depth_at_start().is_some() {
        line(config).iter().for_each(|line| tracing::warn!("{line}"));
    }
}

/// Returns whether the hand does not reach the wall.
pub(super) fn is_missed(config: &Config) -> bool {
    config.wall_contact().is_some_and(|met| met.posture.is_err())
}

/// Returns the line about the wall; `None` without a wall.
pub(super) fn line(config: &Config) -> Option<String> {
    if let Some(depth) = config.wall_depth_at_start() {
        return Some(format!("contact warning   the object starts {depth:.3} m in the wall"));
    }
    let met = config.wall_contact()?;
    let away = met.displacement.norm();
    Some(match met.posture {
        Ok(posture) => {
            let is_poor = !config.contact_bounds.permit(&posture);
            let remark = if is_poor { remark(&config.contact_bounds) } else { String::new() };
            let warning = if is_poor { "warning   " } else { "" };
            format!(
                "contact {warning}wall {away:.3} m from the start: {}{remark}",
                quality(&posture)
            )
        }
        Err(reason) => {
            let wall = match away.is_finite() {
                true => format!("wall {away:.3} m from the start"),
                false => "wall out of reach".to_owned(),
            };
            format!("contact warning   {wall}, in pose mode: {reason}; {}", remedy(&reason))
        }
    })
}

/// Returns the keys that bring the wall within reach.
const fn remedy(reason: &OutOfReach) -> &'static str {
    match reason {
        OutOfReach::NoPosture { .. } => {
            "move remote.wall.point_m towards the object, or raise controller.pose_gain"
        }
        OutOfReach::AtStart { .. } => {
            "start the joints elsewhere: start_deg (start_m), else rest_deg (rest_m)"
        }
        OutOfReach::NoGain { .. } => "raise it",
        OutOfReach::JointRange { .. } => {
            "move remote.wall.point_m towards the object, or widen its limit_deg (limit_m)"
        }
    }
}

/// Returns the posture's figures in words.
fn quality(ContactPosture { sigma_min, friction_n, .. }: &ContactPosture) -> String {
    format!("smallest singular value {sigma_min:.3}, dry friction {friction_n:.2} N at the grip")
}

fn remark(PostureBounds { min_sigma, max_friction_n }: &PostureBounds) -> String {
    format!(
        "; beyond arm.min_singular_value = {min_sigma} or arm.max_grip_friction_n = {max_friction_n}: \
         the hand feels friction and torque errors many times"
    )
}

/// Returns the contact as JSON, `null` without a wall.
pub(super) fn json(config: &Config) -> serde_json::Value {
    if let Some(depth_m) = config.wall_depth_at_start() {
        return serde_json::json!({ "starts_in_the_wall_m": depth_m });
    }
    let Some(met) = config.wall_contact() else { return serde_json::Value::Null };
    let way_m = met.displacement.norm();
    match met.posture {
        Ok(posture) => serde_json::json!({
            "way_m": way_m,
            "smallest_singular_value": posture.sigma_min,
            "friction_n": posture.friction_n,
            "is_good": config.contact_bounds.permit(&posture),
        }),
        Err(reason) => serde_json::json!({ "way_m": way_m, "out_of_reach": reason.to_string() }),
    }
}
