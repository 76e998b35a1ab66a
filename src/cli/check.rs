//! `frhc check`: is this configuration fit to run? Touches no bus.

use crate::cli::args::Check;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::config::Config;

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
    Ok(())
}
