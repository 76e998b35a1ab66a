//! `[controller]`: control law of the paper (Williams 1997, Eq. 5 to 9), with the gains of each Cartesian axis.

use std::time::Duration;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use crate::extensions::{self, Basis};
use crate::joints::JointParameters;
use crate::problem::Problems;
use crate::raw::{self, six};
use crate::value::Value;
use crate::{arm, interpretation, scale};
use controller::Settings;
use controller::arm::Arm;
use controller::channels::Channels;
use controller::command::CommandLaw;
use controller::gains::Gains;
use controller::limits::AssistFraction;
use controller::period::Period;
use controller::reflection::Reflection;
use controller::switches::CommandMode;
use toml_input::List;

/// Reads the command mode at the start.
pub(super) fn mode(raw: &raw::File, problems: &mut Problems<'_>) -> Option<CommandMode> {
    let modes = [("rate", CommandMode::Rate), ("pose", CommandMode::Pose)];
    problems.one_of(&raw.controller.mode, &modes)
}

/// Values of other sections that the controller depends on; each `None` after a problem.
pub(super) struct OtherSections<'g> {
    pub(super) joints: Option<&'g [JointParameters; 6]>,
    pub(super) x_6_g: Option<Isometry3<f64>>,
    pub(super) gravity: Option<[f64; 3]>,
    pub(super) period: Option<Duration>,
}

/// Reads the settings of the controller. Returns `None` after a problem.
pub(super) fn settings(
    raw: &raw::File,
    around: &OtherSections<'_>,
    problems: &mut Problems<'_>,
) -> Option<Settings> {
    let given = &raw.controller;
    let interpretation = interpretation::interpretation(given, problems);
    let period = around.period.and_then(|period| {
        problems.take(&raw.node.sync_period_us, Period::new(period.as_secs_f64()))
    });
    let rate_gain = gains(&given.rate_gain_per_s, "K_V", problems);
    let pose_gain = gains(&given.pose_gain, "K_P", problems);
    let wrench_gain = gains(&given.wrench_gain, "K_T", problems);
    let damping = damping(given, problems);
    let channels = channels(given, problems);
    let reflection = reflection(raw, wrench_gain, problems);
    let assist_fraction = given
        .assist_fraction
        .get()
        .and_then(|fraction| problems.take(&given.assist_fraction, AssistFraction::new(fraction)));
    let bounds = scale::bounds(given, problems);
    let arm = arm(raw, around, problems);
    let coupling = arm::coupling(raw, problems);
    let calibration = around.joints.map(|joints| arm::calibration(joints, coupling));
    let extensions = extensions::extensions(
        given,
        Basis {
            joints: around.joints,
            arm: arm.as_ref(),
            calibration: calibration.as_ref(),
            period,
        },
        problems,
    );

    Some(Settings {
        interpretation: interpretation?,
        period: period?,
        arm: arm?,
        calibration: calibration?,
        channels: channels?,
        command: CommandLaw {
            rate_gain: rate_gain?,
            pose_gain: pose_gain?,
            pose_deadband: given.pose_deadband.or(false).get()?,
        },
        reflection: reflection?,
        damping: damping?,
        assist_fraction: assist_fraction?,
        bounds: bounds?,
        dry_friction: around.joints?.each_ref().map(|joint| joint.plant.friction.coulomb).into(),
        extensions,
    })
}

fn gains(
    value: &Value<List<f64, 6>>,
    quantity: &'static str,
    problems: &mut Problems<'_>,
) -> Option<Gains> {
    let List(values) = value.get()?;
    problems.take(value, Gains::new(values, quantity))
}

fn damping(given: &raw::Controller, problems: &mut Problems<'_>) -> Option<Gains> {
    let before = problems.count();
    let linear = problems.none_negative(&given.damping_ns_per_m);
    let angular = problems.none_negative(&given.damping_nms_per_rad);
    let made = Gains::new(six(linear?, angular?), "K_D");
    problems.take_unless_noted(before, &given.damping_ns_per_m, made)
}

/// Reads deadbands and return to centre of the Cartesian axes, by constant force or spring, with optional walls.
fn channels(given: &raw::Controller, problems: &mut Problems<'_>) -> Option<Channels> {
    let laws = [("constant-force", false), ("spring", true)];
    let law = given.centring_law.or("constant-force".to_owned());
    let is_spring = problems.one_of(&law, &laws);
    let walls = given.walls.as_ref().map(|given| walls(given, problems));

    let before = problems.count();
    let [deadband_m, deadband_rad] =
        [&given.deadband_m, &given.deadband_rad].map(|value| problems.none_negative(value));
    let [centring_n, centring_nm] =
        [&given.centring_n, &given.centring_nm].map(|value| problems.none_negative(value));
    let made = Channels::new(six(deadband_m?, deadband_rad?), six(centring_n?, centring_nm?));
    let channels = problems.take_unless_noted(before, &given.deadband_m, made)?;

    let channels = if is_spring? { channels.as_springs() } else { channels };
    let Some(walls) = walls else { return Some(channels) };
    let (at, stiffness) = walls?;
    channels.with_wall(at, stiffness).ok()
}

/// Reads distance and stiffness of the walls on each Cartesian axis, in m (rad) and N/m (N·m/rad).
fn walls(given: &raw::Walls, problems: &mut Problems<'_>) -> Option<([f64; 6], [f64; 6])> {
    let [at_m, at_rad] = [&given.at_m, &given.at_rad].map(|value| problems.none_negative(value));
    let [linear, angular] = [&given.stiffness_n_per_m, &given.stiffness_nm_per_rad]
        .map(|value| problems.none_negative(value));
    Some((six(at_m?, at_rad?), six(linear?, angular?)))
}

fn reflection(
    raw: &raw::File,
    gain: Option<Gains>,
    problems: &mut Problems<'_>,
) -> Option<Reflection> {
    let given = &raw.controller;
    let before = problems.count();
    let max_force = problems.positive(&given.max_force_n);
    let max_moment = problems.positive(&given.max_moment_nm);
    // An invalid sensor pose is reported by [remote].
    let finite =
        |List(parts): List<f64, 3>| parts.map(|part| if part.is_finite() { part } else { 0.0 });
    let [x, y, z] = finite(raw.remote.sensor_m.get()?);
    let turned = finite(raw.remote.sensor_deg.or(List::default()).get()?);
    let [about_x, about_y, about_z] = turned.map(f64::to_radians);
    let r_m_s = UnitQuaternion::from_euler_angles(about_x, about_y, about_z);
    let x_m_s = Isometry3::from_parts(Translation3::new(x, y, z), r_m_s);
    let made = Reflection::new(x_m_s, gain?, max_force?, max_moment?);
    problems.take_unless_noted(before, &given.max_force_n, made)
}

fn arm(raw: &raw::File, around: &OtherSections<'_>, problems: &mut Problems<'_>) -> Option<Arm<6>> {
    let links = around.joints?.each_ref().map(|joint| joint.plant.link);
    let arm = Arm::new(links, around.x_6_g?, around.gravity?);
    let is_noted = problems.is_noted_within(&raw.joint) || problems.is_noted_within(&raw.arm);
    if is_noted { arm.ok() } else { problems.take(&raw.joint, arm) }
}
