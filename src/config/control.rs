//! `[controller]`: the paper's gains.

use std::time::Duration;

use nalgebra::Isometry3;

use crate::arm;
use crate::extensions;
use crate::interpretation;
use crate::joints::JointParameters;
use crate::problem::Problems;
use crate::raw;
use crate::raw::six;
use controller::Settings;
use controller::arm::Arm;
use controller::channels::Channels;
use controller::command::CommandLaw;
use controller::gains::Gains;
use controller::limits::AssistFraction;
use controller::period::Period;
use controller::reflection::Reflection;
use controller::switches::Mode;

/// What a displacement of the hand means at the start.
pub(super) fn mode(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Mode> {
    let modes = [("rate", Mode::Rate), ("pose", Mode::Pose)];
    problems.one_of("controller.mode", &raw.controller.mode, &modes)
}

/// The controller; `None` where a problem has been noted.
pub(super) fn settings(
    raw: &raw::File,
    joints: &[JointParameters; 6],
    x_6_g: &Isometry3<f64>,
    gravity: [f64; 3],
    period: Duration,
    problems: &mut Problems<'_>,
) -> Option<Settings> {
    let given = &raw.controller;
    let interpretation = interpretation::interpretation(given, problems);
    let period = problems.take("node.sync_period_us", Period::new(period.as_secs_f64()));
    let mut gains = |key: &str, values, quantity| {
        problems.take(&format!("controller.{key}"), Gains::new(values, quantity))
    };
    let rate_gain = gains("rate_gain_per_s", given.rate_gain_per_s.0, "K_V");
    let pose_gain = gains("pose_gain", given.pose_gain.0, "K_P");
    let wrench_gain = gains("wrench_gain", given.wrench_gain.0, "K_T");

    let before = problems.count();
    let damping = six(
        problems.none_negative("controller.damping_ns_per_m", given.damping_ns_per_m.0),
        problems.none_negative("controller.damping_nms_per_rad", given.damping_nms_per_rad.0),
    );
    let damping = Gains::new(damping, "K_D");
    let damping = problems.take_unless_noted(before, "controller.damping_ns_per_m", damping);

    let before = problems.count();
    let deadband = six(
        problems.none_negative("controller.deadband_m", given.deadband_m.0),
        problems.none_negative("controller.deadband_rad", given.deadband_rad.0),
    );
    let plateau = six(
        problems.none_negative("controller.centring_n", given.centring_n.0),
        problems.none_negative("controller.centring_nm", given.centring_nm.0),
    );
    let channels = Channels::new(deadband, plateau);
    let channels = problems.take_unless_noted(before, "controller.deadband_m", channels);
    let channels = channels.and_then(|channels| shaped(given, channels, problems));
    // Where the sensor is no place, its own section says so.
    let [x, y, z] = raw.remote.sensor_m.0.map(|part| if part.is_finite() { part } else { 0.0 });
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
    let links = joints.each_ref().map(|joint| joint.plant.link);
    let arm = Arm::new(links, *x_6_g, gravity);
    let is_noted = problems.is_noted("joint[") || problems.is_noted("arm.");
    let arm = if is_noted { arm.ok() } else { problems.take("joint", arm) };

    let calibration = arm::calibration(joints, arm::coupling(raw, problems));
    let extensions = extensions::extensions(given, arm.as_ref()?, &calibration, period?, problems);

    Some(Settings {
        interpretation: interpretation?,
        period: period?,
        arm: arm?,
        calibration,
        channels: channels?,
        command: CommandLaw {
            rate_gain: rate_gain?,
            pose_gain: pose_gain?,
            pose_deadband: given.pose_deadband,
        },
        reflection: reflection?,
        damping: damping?,
        assist_fraction: assist_fraction?,
        extensions,
    })
}

/// The channels with their variants: springs, walls.
fn shaped(
    given: &raw::Controller,
    channels: Channels,
    problems: &mut Problems<'_>,
) -> Option<Channels> {
    let laws = [("constant-force", false), ("spring", true)];
    let law = given.centring_law.as_deref().unwrap_or("constant-force");
    let is_spring = problems.one_of("controller.centring_law", law, &laws)?;
    let channels = if is_spring { channels.as_springs() } else { channels };
    let Some(walls) = &given.walls else { return Some(channels) };
    let mut three =
        |key: &str, values| problems.none_negative(&format!("controller.walls.{key}"), values);
    let at = six(three("at_m", walls.at_m.0), three("at_rad", walls.at_rad.0));
    let stiffness = six(
        three("stiffness_n_per_m", walls.stiffness_n_per_m.0),
        three("stiffness_nm_per_rad", walls.stiffness_nm_per_rad.0),
    );
    channels.with_wall(at, stiffness).ok()
}
