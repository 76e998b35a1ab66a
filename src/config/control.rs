//! `[controller]`: the paper's gains.

use std::time::Duration;

use nalgebra::Isometry3;

use crate::config::joints;
use crate::config::joints::Joint;
use crate::config::problem::Problems;
use crate::config::raw;
use crate::controller::Settings;
use crate::controller::arm::Arm;
use crate::controller::assist::Damping;
use crate::controller::channels::Channels;
use crate::controller::command::CommandLaw;
use crate::controller::gains::Gains;
use crate::controller::limits::AssistFraction;
use crate::controller::orientation::Orientation;
use crate::controller::reflection::Reflection;
use crate::controller::switches::Mode;

/// What a displacement of the hand means at the start.
pub(super) fn mode(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Mode> {
    match raw.controller.mode.as_str() {
        "rate" => Some(Mode::Rate),
        "pose" => Some(Mode::Pose),
        other => {
            problems
                .add("controller.mode", format_args!("\"{other}\": there is \"rate\", \"pose\""));
            None
        }
    }
}

/// The controller; `None` where a problem has been noted.
pub(super) fn settings(
    raw: &raw::File,
    joints: &[Joint; 6],
    x_6_g: &Isometry3<f64>,
    gravity: [f64; 3],
    period: Duration,
    problems: &mut Problems<'_>,
) -> Option<Settings> {
    let given = &raw.controller;
    if given.preset != "consistent" {
        let reason = format!("\"{}\": there is \"consistent\"", given.preset);
        problems.add("controller.preset", reason);
    }
    let mut gains = |key: &str, values, quantity| {
        problems.take(&format!("controller.{key}"), Gains::new(values, quantity))
    };
    let rate_gain = gains("rate_gain_per_s", given.rate_gain_per_s, "K_V");
    let pose_gain = gains("pose_gain", given.pose_gain, "K_P");
    let wrench_gain = gains("wrench_gain", given.wrench_gain, "K_T");

    let before = problems.count();
    let damping = six(
        problems.none_negative("controller.damping_ns_per_m", given.damping_ns_per_m),
        problems.none_negative("controller.damping_nms_per_rad", given.damping_nms_per_rad),
    );
    let damping = Gains::new(damping, "K_D");
    let damping = problems.take_unless_noted(before, "controller.damping_ns_per_m", damping);

    let before = problems.count();
    let deadband = six(
        problems.none_negative("controller.deadband_m", given.deadband_m),
        problems.none_negative("controller.deadband_rad", given.deadband_rad),
    );
    let plateau = six(
        problems.none_negative("controller.centring_n", given.centring_n),
        problems.none_negative("controller.centring_nm", given.centring_nm),
    );
    let channels = Channels::new(deadband, plateau);
    let channels = problems.take_unless_noted(before, "controller.deadband_m", channels);
    let damping = damping.and_then(|gain| {
        problems.take("node.sync_period_us", Damping::new(gain, period.as_secs_f64()))
    });
    // Where the sensor is no place, its own section says so.
    let [x, y, z] = raw.remote.sensor_m.map(|part| if part.is_finite() { part } else { 0.0 });
    let before = problems.count();
    let max_force = problems.positive("controller.max_force_n", given.max_force_n);
    let max_moment = problems.positive("controller.max_moment_nm", given.max_moment_nm);
    let x_m_s = Isometry3::translation(x, y, z);
    let reflection = wrench_gain.and_then(|gain| {
        let made = Reflection::new(x_m_s, gain, max_force, max_moment);
        problems.take_unless_noted(before, "controller.max_force_n", made)
    });
    let assist_fraction = AssistFraction::new(given.assist_fraction);
    let assist_fraction = problems.take("controller.assist_fraction", assist_fraction);
    let links = joints.each_ref().map(|joint| joint.link);
    let arm = problems.take("joint", Arm::new(links, *x_6_g, gravity));

    Some(Settings {
        arm: arm?,
        calibration: joints::calibration(joints),
        channels: channels?,
        command: CommandLaw {
            orientation: Orientation::EulerZyx,
            rate_gain: rate_gain?,
            pose_gain: pose_gain?,
            pose_deadband: false,
        },
        reflection: reflection?,
        damping: damping?,
        assist_fraction: assist_fraction?,
    })
}

/// Three linear and three angular numbers as one six-vector.
const fn six([x, y, z]: [f64; 3], [about_x, about_y, about_z]: [f64; 3]) -> [f64; 6] {
    [x, y, z, about_x, about_y, about_z]
}
