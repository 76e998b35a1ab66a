//! `frhc commission`: the proof test of the drives before use. Each must stop by its own timers when its master is lost.

use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::config_arg::ConfigArg;
use crate::exit::{Failure, Kind, OrFail};
use crate::interfaces::{self, Interfaces};
use crate::{check, print, signal_flag};
use canopen::master::check::Check;
use canopen::nameplate::StoredValue;
use canopen::plan::NodePlan;
use config::Config;
use node::proof_test::{DriveResult, ProofTestReport, WatchdogExpiry};
use node::{BringUpError, Node};
use remote::site::VirtualSite;

/// `frhc commission`.
#[derive(Debug, Args)]
#[command(
    after_help = "No other master may run on the buses meanwhile. The drives are enabled at zero torque; the arm is not armed.\n\nExamples:\n  \
        frhc commission --config config/kraft_like.toml --prove -i can0\n  \
        frhc commission --config config/kraft_like.toml --prove --json | jq .lasting_ms"
)]
pub struct Commission {
    #[command(flatten)]
    config: ConfigArg,
    #[command(flatten)]
    interfaces: Interfaces,
    /// Boot the drives, enable them at zero torque, then stop RPDOs and heartbeat in turn and measure when each disables itself.
    #[arg(long)]
    prove: bool,
    /// Print the report as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the proof test and prints its report.
pub(super) fn run(args: &Commission) -> Result<(), Failure> {
    if !args.prove {
        let reason = "no task given; add --prove";
        return Err(Failure::new(Kind::Usage, reason));
    }
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    check::refuse_simulated_link(&config, "commission")?;
    // --prove overrides `safety.prove_drives = false`.
    let config = config.with_proof();
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let stop = signal_flag::register([SIGINT, SIGTERM])?;
    // A closed terminal does not stop the drives.
    signal_flag::register([SIGHUP])?;
    let bus = interfaces::open(&config, &names)?;
    let mut node = Node::new(&config, bus, VirtualSite::new(&config.remote, config.period));
    let booted = node.bring_up(&mut || stop.load(Ordering::Relaxed));
    if let Err(given_up @ (BringUpError::GivenUp | BringUpError::LeftOn(_))) = booted {
        return Err(failure(given_up));
    }
    let report =
        Report { config: &config, plans: drives(&config), proof: node.proof_test_report().clone() };
    print::line(&if args.json { report.json().to_string() } else { report.text() });
    booted.map_err(failure)?;
    node.shut_down(&mut || false).or_fail(Kind::Drive)
}

/// Logs a warning if the proof test is disabled.
pub(super) fn warn(config: &Config) {
    if !config.safety.protection.proves_drives {
        tracing::warn!(
            "DRIVES NOT TESTED: safety.prove_drives = false, so no drive is known to stop when its master is \
             lost; forces stay below {} N",
            config.controller.reflection.max_force()
        );
    }
}

fn failure(error: BringUpError) -> Failure {
    let kind = match error {
        BringUpError::Bus(_) | BringUpError::Unfit(_) => Kind::Bus,
        BringUpError::Boot(_)
        | BringUpError::NotEnabled(_)
        | BringUpError::Mode(_)
        | BringUpError::Homing(_)
        | BringUpError::ProofTest(_)
        | BringUpError::GivenUp
        | BringUpError::LeftOn(_) => Kind::Drive,
    };
    Failure::new(kind, error)
}

fn drives(config: &Config) -> Vec<NodePlan> {
    config.node_plans().into_iter().map(|(_, plan)| plan).filter(NodePlan::is_drive).collect()
}

/// Report on the proof test of a configuration.
struct Report<'c> {
    config: &'c Config,
    plans: Vec<NodePlan>,
    proof: ProofTestReport,
}

impl Report<'_> {
    fn text(&self) -> String {
        let mut lines = vec![format!(
            "{:24} {:>18} {:>18} {:>18}",
            "ms set/measured", "RPDO timeout", "heartbeat", "guarding"
        )];
        let cap = self.config.force_cap();
        for (drive, plan) in self.proof.drives.iter().zip(&self.plans) {
            let [rpdo, heartbeat, guarding] =
                [drive.rpdo, drive.heartbeat, drive.guarding].map(cell);
            lines.push(format!("{:24} {rpdo:>18} {heartbeat:>18} {guarding:>18}", drive.name));
            let stops_by: Vec<_> = drive.expiries().map(|one| one.watchdog.to_string()).collect();
            lines.push(match drive.reaction_time() {
                None => "  stops by: nothing".to_owned(),
                Some(time) => {
                    let (timers, force) = (stops_by.join(", "), cap.max_force(time));
                    format!("  stops by: {timers}; at most {force:.1} N at the grip")
                }
            });
            let held = plan.protections().into_iter().map(|check| read_back(drive, &check));
            lines.push(format!("  read back: {}", held.collect::<Vec<_>>().join(", ")));
            let holds: Vec<_> = drive.held.iter().map(StoredValue::to_string).collect();
            lines.push(format!("  holds: {}", holds.join(", ")));
        }
        lines.push(self.verdict());
        lines.join("\n")
    }

    fn verdict(&self) -> String {
        let max_force = self.config.controller.reflection.max_force();
        match self.proof.reaction_time() {
            None if self.proof.drives.is_empty() => {
                "no drive was tested, nothing is proven: the arm cannot be armed".to_owned()
            }
            None => "at least one drive is not proven to stop by itself: the arm cannot be armed"
                .to_owned(),
            Some(lasting) => match self.config.force_cap().check(lasting) {
                Ok(()) => format!(
                    "a drive that loses its master exerts torque for at most {:.1} ms: max_force_n = {max_force} is allowed",
                    millis(lasting)
                ),
                Err(refused) => format!("the arm cannot be armed: {refused}"),
            },
        }
    }

    fn json(&self) -> serde_json::Value {
        let drive = |(drive, plan): (&DriveResult, &NodePlan)| {
            let held = plan.protections().into_iter().map(|check| {
                let value = (!drive.missing.contains(&check.object))
                    .then(|| check.expected_value().to_string());
                (check.object.to_string(), serde_json::json!(value))
            });
            serde_json::json!({
                "name": drive.name,
                "node": drive.node.raw(),
                "rpdo": drive.rpdo.map(timer),
                "heartbeat": drive.heartbeat.map(timer),
                "guarding": drive.guarding.map(timer),
                "read_back": held.collect::<serde_json::Map<_, _>>(),
                "holds": drive.held.iter().map(StoredValue::to_string).collect::<Vec<_>>(),
            })
        };
        let lasting = self.proof.reaction_time();
        let force = lasting.map(|lasting| self.config.force_cap().check(lasting));
        serde_json::json!({
            "drives": self.proof.drives.iter().zip(&self.plans).map(drive).collect::<Vec<_>>(),
            "lasting_ms": lasting.map(millis),
            "max_force_n": self.config.controller.reflection.max_force(),
            "may_arm": force.is_some_and(|allowed| allowed.is_ok()),
        })
    }
}

fn read_back(drive: &DriveResult, check: &Check) -> String {
    if drive.missing.contains(&check.object) {
        format!("{} missing", check.object)
    } else {
        format!("{} = {}", check.object, check.expected_value())
    }
}

fn cell(expiry: Option<WatchdogExpiry>) -> String {
    expiry.map_or_else(
        || "-".to_owned(),
        |WatchdogExpiry { watchdog, measured, .. }| {
            format!("{} / {:.1}", watchdog.millis, millis(measured))
        },
    )
}

fn timer(WatchdogExpiry { watchdog, measured, .. }: WatchdogExpiry) -> serde_json::Value {
    serde_json::json!({
        "object": watchdog.object.to_string(),
        "said_ms": watchdog.millis,
        "measured_ms": millis(measured),
    })
}

fn millis(span: Duration) -> f64 {
    span.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use canopen::NodeId;

    #[test]
    fn hazard_16_verdict_without_tested_drives_accuses_none() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let verdict = |results| {
            let proof = ProofTestReport { drives: results };
            Report { config: &config, plans: drives(&config), proof }.verdict()
        };
        let reason = "no drive was tested, nothing is proven: the arm cannot be armed";
        assert_eq!(verdict(Vec::new()), reason);
        let untested = DriveResult {
            name: "joint 1 (azimuth)".to_owned(),
            node: NodeId::new(1).unwrap(),
            rpdo: None,
            heartbeat: None,
            guarding: None,
            missing: Vec::new(),
            held: Vec::new(),
        };
        assert!(verdict(vec![untested]).starts_with("at least one drive is not proven"));
    }
}
