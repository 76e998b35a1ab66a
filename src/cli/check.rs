//! `frhc check`: is this configuration fit to run? Touches no bus.

use crate::cli::args::Check;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::config::Config;
use crate::controller::arm::JointKind;
use crate::controller::stability::Finding;
use crate::controller::stability::Verdict;

/// Loads the configuration, which checks it, and prints what it comes to.
pub(super) fn run(args: &Check, is_verbose: bool) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    let loads = config.loads();
    let findings = config.findings();
    if args.json {
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
            "gains": findings.iter().map(json).collect::<Vec<_>>(),
        });
        print::line(&report.to_string());
        return Ok(());
    }
    print::line(&format!("{}: in order", args.config.config.display()));
    print::line(&format!("SYNC every {} µs", config.period.as_micros()));
    for (bus, load) in config.buses.iter().zip(&loads) {
        print::line(&format!(
            "bus {:10} {load}, limit {:.0} %, {}",
            bus.name, bus.load_limit_percent, bus.interface
        ));
    }
    for joint in &config.joints {
        let unit = match joint.link.kind {
            JointKind::Revolute => "N·m",
            JointKind::Prismatic => "N",
        };
        print::line(&format!(
            "joint {:16} node {:3}, {:.4} {unit} a step of 1 per mille, at most {} {unit}",
            joint.name,
            joint.node.raw(),
            joint.calibration.resolution(),
            joint.max_torque
        ));
    }
    gains(&findings, is_verbose);
    Ok(())
}

/// One line for a log: how many gains rest on the hand.
pub(super) fn warn(config: &Config) {
    let findings = config.findings();
    let count = |verdict| findings.iter().filter(|finding| finding.verdict == verdict).count();
    let (warnings, refused) = (count(Verdict::Warns), count(Verdict::Refuses));
    if refused > 0 {
        tracing::warn!(warnings, refused, "gains are unstable; see `frhc check`");
    } else if warnings > 0 {
        tracing::info!(warnings, "gains rest on the hand; see `frhc check`");
    }
}

/// How many inequalities hold, and each that does not; all of them if asked for more.
fn gains(findings: &[Finding], is_verbose: bool) {
    let count = |verdict| findings.iter().filter(|finding| finding.verdict == verdict).count();
    print::line(&format!(
        "gains: {} inequalities hold, {} warnings, {} refused",
        count(Verdict::Holds),
        count(Verdict::Warns),
        count(Verdict::Refuses)
    ));
    for (finding, others) in shown(findings, is_verbose) {
        let others = if others > 0 { format!(" (and {others} more axes)") } else { String::new() };
        print::line(&format!("{:8} {finding}{others}", finding.verdict.name()));
    }
}

/// All findings, or of those of one kind that do not hold the worst, and how many there are besides.
fn shown(findings: &[Finding], is_verbose: bool) -> Vec<(&Finding, usize)> {
    if is_verbose {
        return findings.iter().map(|finding| (finding, 0)).collect();
    }
    let mut worst: Vec<(&Finding, usize)> = Vec::new();
    for finding in findings.iter().filter(|finding| finding.verdict != Verdict::Holds) {
        let kind = |other: &Finding| (other.topic, other.verdict);
        match worst.iter_mut().find(|(other, _)| kind(other) == kind(finding)) {
            None => worst.push((finding, 0)),
            Some((other, others)) => {
                *others += 1;
                if finding.excess() > other.excess() {
                    *other = finding;
                }
            }
        }
    }
    worst
}

fn json(finding: &Finding) -> serde_json::Value {
    serde_json::json!({
        "topic": finding.topic.name(),
        "axis": finding.axis,
        "inequality": finding.inequality,
        "left": finding.left,
        "right": finding.right,
        "unit": finding.unit,
        "verdict": finding.verdict.name(),
        "meaning": finding.meaning,
    })
}
