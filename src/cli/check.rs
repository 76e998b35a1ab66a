//! `frhc check`: is this configuration fit to run? Touches no bus.

use std::cmp::Reverse;

use crate::cli::args::Check;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::config::Config;
use crate::controller::stability::finding::Finding;
use crate::controller::stability::finding::Side;

/// Loads the configuration, which checks it, and prints what it comes to.
pub(super) fn run(args: &Check) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    let loads = config.loads();
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
            "gains": config.findings().iter().map(json).collect::<Vec<_>>(),
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
        print::line(&format!(
            "joint {:10} node {:3}, {:.4} N·m a step of 1 per mille, at most {} N·m",
            joint.name,
            joint.node.raw(),
            joint.calibration.resolution(),
            joint.max_torque
        ));
    }
    for group in groups(&config.findings()) {
        print::line(&group);
    }
    Ok(())
}

/// A finding as one JSON object; a side without bound is null.
fn json(finding: &Finding) -> serde_json::Value {
    let side = |side: &Side| {
        serde_json::json!({
            "symbols": side.symbols,
            "value": side.value,
            "unit": side.unit,
        })
    };
    serde_json::json!({
        "name": finding.name,
        "axis": finding.axis,
        "verdict": finding.verdict.to_string(),
        "left": side(&finding.left),
        "right": side(&finding.right),
        "reason": finding.reason,
    })
}

/// Findings in lines, the worst verdict first: an inequality that comes to the same on several axes is
/// told for the one where it is tightest, with the names of the others.
fn groups(findings: &[Finding]) -> Vec<String> {
    let mut groups: Vec<Vec<&Finding>> = Vec::new();
    for finding in findings {
        let is_alike =
            |other: &&Finding| (other.name, other.verdict) == (finding.name, finding.verdict);
        match groups.iter_mut().find(|group| group.first().is_some_and(is_alike)) {
            Some(group) => group.push(finding),
            None => groups.push(vec![finding]),
        }
    }
    groups.sort_by_key(|group| Reverse(group.first().map(|finding| finding.verdict)));
    groups.iter().filter_map(|group| line(group)).collect()
}

fn line(group: &[&Finding]) -> Option<String> {
    let tightest = group.iter().max_by(|a, b| a.share().total_cmp(&b.share()))?;
    let others = group.iter().map(|finding| finding.axis).filter(|axis| *axis != tightest.axis);
    let others: Vec<&str> = others.collect();
    let also =
        if others.is_empty() { String::new() } else { format!(" (also {})", others.join(", ")) };
    Some(format!("gains {:10} {tightest}{also}", tightest.verdict.to_string()))
}
