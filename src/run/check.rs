//! `frhc check`: validates a configuration or EDS files. Opens no bus.

pub mod contact;
mod eds;
mod far_side;
mod zero;

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use crate::exit::{Failure, Kind, OrFail};
use crate::{gains, print, stopping};
use config::robots::RobotArm;
use config::{BusSettings, Config, JointParameters};
use controller::arm::JointKind;
use controller::stability::finding::{Finding, Verdict};
use units::math;

/// `frhc check`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("subject").required(true).args(["config", "eds"]))]
pub struct Check {
    /// Configuration file (TOML).
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// EDS or DCF to check by itself: lists every finding with its line. Repeatable.
    #[arg(long, value_name = "FILE")]
    pub eds: Vec<PathBuf>,
    /// Print the findings as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Checks the configuration or the EDS files.
///
/// # Errors
/// Returns an error for an invalid configuration (exit 3), or an EDS with errors (exit 1).
pub fn run(args: &Check) -> Result<(), Failure> {
    match &args.config {
        Some(file) => configuration(file, args.json),
        None => eds::run(&args.eds, args.json),
    }
}

/// Describes strength and direction of gravity. A base mounted upside down is valid, but must be visible.
fn gravity(config: &Config) -> String {
    let [x, y, z] = config.gravity;
    let strength = math::hypot(math::hypot(x, y), z);
    if strength <= 0.0 {
        return "gravity 0: the arm is balanced by springs or counterweights".to_owned();
    }
    let [x, y, z] = config.gravity.map(|part| part / strength);
    let mount = if z > 0.0 { "; the base is mounted upside down" } else { "" };
    format!("gravity {strength:.2} m/s² along ({x:.2}, {y:.2}, {z:.2}) in the base frame{mount}")
}

fn robot_json(arm: &RobotArm) -> serde_json::Value {
    serde_json::json!({
        "name": arm.name,
        "file": arm.file,
        "joints": arm.joints.len(),
        "sigma_min": arm.following().sigma_min(),
    })
}

/// Describes the arm that holds the commanded object.
fn robot(arm: &RobotArm) -> String {
    let following = arm.following();
    let [x, y, z] = following.pose().translation.vector.into();
    format!(
        "robot {:10} {} joints, starts at ({x:.3}, {y:.3}, {z:.3}) m, smallest singular value {:.2}, damped below {:.2}",
        arm.name,
        arm.joints.len(),
        following.sigma_min(),
        arm.law().inverse().threshold()
    )
}

/// Logs a warning if no switch box is configured, without which arming is refused.
pub(super) fn warn_no_switch_box(config: &Config) {
    if let Err(reason) = config.switch_box() {
        tracing::warn!("{reason}");
    }
}

/// Refuses a simulated link for a `command` on real buses.
pub(super) fn refuse_simulated_link(config: &Config, command: &str) -> Result<(), Failure> {
    if config.link.simulated.is_none() {
        return Ok(());
    }
    let reason = format!(
        "{}: [remote.link] describes a simulated link, which demo, campaign and experiment have; \
         for {command}, keep max_age_ms alone",
        config.file.display()
    );
    Err(Failure::new(Kind::Configuration, reason))
}

/// Refuses a commanded side in another process, for a `command` that simulates it.
///
/// # Errors
/// When `remote.kind` is `link` or `both` (exit 3).
pub fn refuse_far_side(config: &Config, command: &str) -> Result<(), Failure> {
    if config.far_side.agreement.is_none() {
        return Ok(());
    }
    let kind = if config.far_side.model_limit.is_some() { "both" } else { "link" };
    let reason = format!(
        "{}: remote.kind: \"{kind}\" is a robot in another process, for frhc run and frhc robot; {command} simulates the \
         commanded side: set \"virtual\"",
        config.file.display()
    );
    Err(Failure::new(Kind::Configuration, reason))
}

/// Checks that `config` has a switch box, without which the node cannot be armed.
///
/// # Errors
/// Returns an error if the switch box is not configured (exit 3).
pub fn require_switch_box(config: &Config) -> Result<(), Failure> {
    let Err(reason) = config.switch_box() else { return Ok(()) };
    Err(Failure::new(Kind::Configuration, format!("{}: {reason}", config.file.display())))
}

/// Loads and validates the configuration, and prints bus load, joints and findings.
fn configuration(file: &Path, json: bool) -> Result<(), Failure> {
    let config = Config::load(file).or_fail(Kind::Configuration)?;
    if json {
        print::line(&report(&config).to_string());
    } else {
        show(file, &config);
    }
    Ok(())
}

/// Prints bus load, joints and findings of a configuration.
pub fn show(file: &Path, config: &Config) {
    lines(file, config).iter().for_each(|line| print::line(line));
}

/// Returns bus load, findings and the drives' timers as one JSON object.
fn report(config: &Config) -> serde_json::Value {
    let buses = config.buses.iter().zip(config.loads()).map(|(bus, load)| {
        serde_json::json!({
            "name": bus.name,
            "bitrate": bus.bitrate,
            "bits_per_cycle": load.used,
            "load_percent": load.percent(),
            "limit_percent": bus.load_limit_percent,
        })
    });
    serde_json::json!({
        "ok": true,
        "sync_period_us": config.period.as_micros(),
        "buses": buses.collect::<Vec<_>>(),
        "contact": contact::json(config),
        "gains": config.findings(),
        "eds": eds::faulty_json(config),
        "eds_warnings": eds::lines(config),
        "stopping": stopping::json(config),
        "zeros": zero::json(config),
        "facts": stopping::facts_json(&config.facts()),
        "cautions": stopping::cautions_json(config),
        "switches": config.switches.is_some(),
        "robot": config.robot.as_ref().map(robot_json),
        "far_side": far_side::json(config),
    })
}

/// Returns bus load, findings, timers and joints as lines.
fn lines(file: &Path, config: &Config) -> Vec<String> {
    let findings = config.findings();
    let mut lines = vec![
        format!("{}: valid{}", file.display(), outlook(config, &findings)),
        format!("SYNC every {} µs", config.period.as_micros()),
    ];
    lines.extend(config.buses.iter().zip(config.loads()).map(|(bus, load)| {
        let BusSettings { name, load_limit_percent, interface, .. } = bus;
        format!("bus {name:10} {load}, limit {load_limit_percent:.0} %, {interface}")
    }));
    lines.push(gravity(config));
    lines.extend(config.robot.iter().map(robot));
    lines.extend(far_side::lines(config));
    lines.extend(config.joints.iter().map(joint));
    lines.extend(zero::lines(config));
    lines.extend(stopping::lines(config));
    lines.extend(eds::lines(config));
    lines.extend(config.switch_box().err().map(|reason| format!("switches warning   {reason}")));
    lines.extend(contact::line(config));
    lines.extend(
        gains::lines(&findings)
            .into_iter()
            .map(|(verdict, line)| format!("gains {:10} {line}", verdict.to_string())),
    );
    lines
}

/// Says whether one may go on with this configuration.
fn outlook(config: &Config, findings: &[Finding]) -> &'static str {
    let has = |verdict| findings.iter().any(|finding| finding.verdict == verdict);
    if has(Verdict::Refuses) {
        ", but unstable (gain_check = \"warn\"): not with a hand at the grip"
    } else if contact::is_missed(config) {
        ", but the hand does not reach the wall"
    } else if config.switch_box().is_err() {
        "; it may boot, but nothing is armed without a switch box"
    } else if has(Verdict::Warns) {
        "; you may go on: what warns below is accepted by design"
    } else {
        "; you may go on"
    }
}

/// Describes a joint's drive.
fn joint(joint: &JointParameters) -> String {
    let unit = match joint.plant.link.kind {
        JointKind::Revolute => "N·m",
        JointKind::Prismatic => "N",
    };
    format!(
        "joint {:16} node {:3}, {:.4} {unit} per step of 1 ‰ rated torque, at most {} {unit}",
        joint.name,
        joint.node.raw(),
        joint.calibration.resolution(),
        joint.plant.actuator.max_torque
    )
}
