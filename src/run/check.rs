//! `frhc check`: is this configuration, or this EDS, fit to run? Touches no bus.

mod eds;

use std::path::Path;
use std::path::PathBuf;

use clap::ArgGroup;
use clap::Args;

use crate::exit::Failure;
use crate::exit::Kind;
use crate::exit::OrFail;
use crate::gains;
use crate::print;
use config::Config;
use controller::arm::JointKind;
use controller::stability::finding::Verdict;

/// `frhc check`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("subject").required(true).args(["config", "eds"]))]
pub struct Check {
    /// The configuration.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// An EDS or DCF, by itself: everything that is wrong with it, by line. Repeatable.
    #[arg(long, value_name = "FILE")]
    pub eds: Vec<PathBuf>,
    /// The findings as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Checks what is named.
///
/// # Errors
/// What is wrong with it (exit 3), or a file that cannot be read (exit 4).
pub fn run(args: &Check) -> Result<(), Failure> {
    match &args.config {
        Some(file) => configuration(file, args.json),
        None => eds::run(&args.eds, args.json),
    }
}

/// Strength and direction of gravity: a base that is mounted upside down is no mistake, but shall be seen.
fn gravity(config: &Config) -> String {
    let [x, y, z] = config.gravity;
    let strength = x.hypot(y).hypot(z);
    if strength <= 0.0 {
        return "gravity balanced: the arm is carried by springs or counterweights".to_owned();
    }
    let [x, y, z] = config.gravity.map(|part| part / strength);
    let mount = if z > 0.0 { ", z of the base points down" } else { "" };
    format!("gravity {strength:.2} m/s² along ({x:.2}, {y:.2}, {z:.2}) of the base{mount}")
}

/// Loads the configuration, which checks it, and prints what it comes to.
fn configuration(file: &Path, json: bool) -> Result<(), Failure> {
    let config = Config::load(file).or_fail(Kind::Configuration)?;
    let loads = config.loads();
    if json {
        let buses = config.buses.iter().zip(&loads).map(|(bus, load)| {
            serde_json::json!({
                "name": bus.name,
                "bitrate": bus.bitrate,
                "bits_per_cycle": load.used,
                "load_percent": load.percent(),
                "limit_percent": bus.load_limit_percent,
            })
        });
        let report = serde_json::json!({
            "ok": true,
            "sync_period_us": config.period.as_micros(),
            "buses": buses.collect::<Vec<_>>(),
            "gains": gains::json(&config.findings()),
            "eds": eds::doubts_json(&config),
        });
        print::line(&report.to_string());
        return Ok(());
    }
    let findings = config.findings();
    let is_unstable = findings.iter().any(|finding| finding.verdict == Verdict::Refuses);
    let but = if is_unstable { ", but unstable, and insisted on" } else { "" };
    print::line(&format!("{}: in order{but}", file.display()));
    print::line(&format!("SYNC every {} µs", config.period.as_micros()));
    for (bus, load) in config.buses.iter().zip(&loads) {
        print::line(&format!(
            "bus {:10} {load}, limit {:.0} %, {}",
            bus.name, bus.load_limit_percent, bus.interface
        ));
    }
    print::line(&gravity(&config));
    for joint in &config.joints {
        let unit = match joint.plant.link.kind {
            JointKind::Revolute => "N·m",
            JointKind::Prismatic => "N",
        };
        print::line(&format!(
            "joint {:16} node {:3}, {:.4} {unit} a step of 1 per mille, at most {} {unit}",
            joint.name,
            joint.node.raw(),
            joint.calibration.resolution(),
            joint.plant.actuator.max_torque
        ));
    }
    eds::doubts(&config).iter().for_each(|doubt| print::line(&doubt.to_string()));
    for (verdict, line) in gains::lines(&findings) {
        print::line(&format!("gains {:10} {line}", verdict.to_string()));
    }
    Ok(())
}
