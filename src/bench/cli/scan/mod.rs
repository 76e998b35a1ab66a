//! `frhc scan`: the nodes on a bus, compared with the configuration.

mod pdos;

use std::collections::BTreeSet;
use std::time::Duration;

use clap::Args;

use crate::live_bus::{BusArgs, NodeArg, Session, SessionError, node_arg};
use crate::scan::pdos::Pdos;
use bus::Bus;
use canopen::plan::NodePlan;
use canopen::{NmtState, NodeId, nmt};
use canopen_tools::diagnostics::scan::NodeReport;
use canopen_tools::diagnostics::silent::Silent;
use canopen_tools::diagnostics::states::{Answer, States};
use run::exit::{Failure, Kind};
use run::print;

/// `frhc scan`.
#[derive(Debug, Args)]
#[command(
    after_help = "Reads 1000h, 1018h, 1008h, 1009h and 100Ah, and writes nothing. Nodes that answer but send no heartbeat are asked \
        for their NMT state by one remote frame each, unless they would start life guarding (100Ch, 100Dh). An SDO server handles one transfer at a \
        time: do not scan while another master configures its nodes.\n\n\
        An NMT-stopped node responds to no SDO request: without a heartbeat only --stopped finds it, by one remote frame. A \
        node with life guarding takes the end of the polls for the loss of its master.\n\n\
        With a configuration it also reports missing nodes (exit 5), nodes with another identity (exit 5) and \
        unexpected ones. The exit code is 1 when no node responds and none is expected.\n\n\
        Examples:\n  frhc scan -i can0\n  frhc scan --config config/kraft_like.toml --pdos\n  \
        frhc scan --config config/kraft_like.toml --json | jq .nodes"
)]
pub struct Scan {
    #[command(flatten)]
    bus: BusArgs,
    /// Node-ids to scan, as 1-16,32; with a configuration also names of joints.
    #[arg(long, value_name = "LIST", default_value = "1-127", value_parser = node_arg::nodes)]
    nodes: Nodes,
    /// Time allowed for each response of a node.
    #[arg(long, value_name = "MS", default_value_t = 100,
        value_parser = clap::value_parser!(u64).range(1..=60_000))]
    timeout: u64,
    /// Minimum time to listen for heartbeats.
    #[arg(long, value_name = "MS", default_value_t = 250)]
    listen: u64,
    /// Ask nodes that do not respond for their NMT state, too: a stopped one answers node guarding alone.
    #[arg(long)]
    stopped: bool,
    /// Read the PDO configuration of every node that responds, too.
    #[arg(long)]
    pdos: bool,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Alias that makes clap parse the list as one value.
type Nodes = Vec<NodeArg>;

/// Comparison of a node with the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// No configuration was given.
    Unchecked,
    /// Identity as configured.
    Expected,
    /// Identity other than the configured one.
    Other,
    /// NMT state without a response to SDO requests.
    Mute,
    /// Node outside the configuration.
    Unexpected,
}

/// Scans the bus and prints the nodes.
pub(super) fn run(args: &Scan) -> Result<(), Failure> {
    let bus = args.bus.select_for(&args.nodes)?;
    let nodes = args.nodes.iter().map(|node| bus.node(node));
    let nodes: BTreeSet<NodeId> = nodes.collect::<Result<_, _>>()?;
    let plans = bus.plans();
    let master = bus.configured.as_ref().map(|(config, _)| config.node_id);
    let mut session = bus.open()?;
    let (timeout, listen) =
        (Duration::from_millis(args.timeout), Duration::from_millis(args.listen));
    let listed: Vec<NodeId> = nodes.iter().copied().collect();
    let mut found = session
        .run(|now, out| {
            canopen_tools::diagnostics::scan::Scan::start(&listed, timeout, listen, now, out)
        })
        .map_err(|error| bus.fail(error))?;
    ask_states(&mut session, &mut found, timeout).map_err(|error| bus.fail(error))?;
    if args.stopped {
        find_stopped(&mut session, &listed, &mut found, timeout)
            .map_err(|error| bus.fail(error))?;
    }
    // Heartbeats also reveal nodes outside of `--nodes`.
    let asked = found.iter().filter(|found| nodes.contains(&found.node));
    let checked: Vec<(&NodeReport, Verdict)> =
        asked.map(|found| (found, check(found, plans.as_deref(), master))).collect();
    let missing: Vec<&NodePlan> = plans
        .iter()
        .flatten()
        .filter(|plan| nodes.contains(&plan.node))
        .filter(|plan| !found.iter().any(|found| found.node == plan.node))
        .collect();
    let answering = found.iter().filter(|found| args.pdos && found.answers);
    let pdos = pdos::read(&mut session, answering.map(|found| found.node), timeout)
        .map_err(|error| bus.fail(error))?;
    if args.json {
        print::line(&json(&bus.interface, &checked, &missing, &pdos).to_string());
    } else {
        table(&checked, plans.as_deref());
        for (node, pdos) in &pdos {
            for pdo in pdos.iter().flatten() {
                print::line(&pdos::line(*node, pdo));
            }
        }
    }
    for (_, unread) in &pdos {
        if let Err(error) = unread {
            print::note(&error.to_string());
        }
    }
    for found in found.iter().filter(|found| found.is_duplicate()) {
        let why = if found.is_answered_twice { "two responses" } else { "two boot-ups" };
        print::note(&format!("node {}: {why}: node-id may be duplicate", found.node.raw()));
    }
    conclude(&checked, &missing, args.stopped)
}

/// Polls the NMT state of nodes without a heartbeat that answer SDO requests, by node guarding.
fn ask_states<B: Bus>(
    session: &mut Session<B>,
    found: &mut [NodeReport],
    timeout: Duration,
) -> Result<(), SessionError> {
    let silent = found.iter().filter(|found| found.answers && found.state.is_none());
    let silent: Vec<NodeId> = silent.map(|found| found.node).collect();
    for (node, answer) in session.run(|now, out| States::start(silent, timeout, now, out))? {
        match answer {
            Answer::State(state) => {
                let found = found.iter_mut().find(|found| found.node == node);
                found.into_iter().for_each(|found| found.state = Some(state));
            }
            Answer::Silent => {}
            Answer::LifeGuarding => print::note(&format!(
                "node {}: state not asked: a poll would start its life guarding (100Ch, 100Dh)",
                node.raw()
            )),
        }
    }
    Ok(())
}

/// Adds nodes that respond to no SDO request, but to node guarding.
fn find_stopped<B: Bus>(
    session: &mut Session<B>,
    listed: &[NodeId],
    found: &mut Vec<NodeReport>,
    timeout: Duration,
) -> Result<(), SessionError> {
    let is_unknown = |node: &&NodeId| !found.iter().any(|found| found.node == **node);
    let silent: Vec<NodeId> = listed.iter().filter(is_unknown).copied().collect();
    let answers = session.run(|now, out| Silent::start(silent, timeout, now, out))?;
    found.extend(answers.into_iter().map(|(node, state)| NodeReport::with_state(node, state)));
    found.sort_by_key(|found| found.node);
    Ok(())
}

/// Compares a node with the configuration. The master's own node-id is expected.
fn check(found: &NodeReport, plans: Option<&[NodePlan]>, master: Option<NodeId>) -> Verdict {
    let Some(plans) = plans else { return Verdict::Unchecked };
    let Some(plan) = plans.iter().find(|plan| plan.node == found.node) else {
        let is_master = master == Some(found.node);
        return if is_master { Verdict::Expected } else { Verdict::Unexpected };
    };
    let identity = plan.identity;
    let expected = [identity.vendor, identity.product, identity.revision].map(Some);
    if !found.answers {
        Verdict::Mute
    } else if [found.vendor, found.product, found.revision] == expected {
        Verdict::Expected
    } else {
        Verdict::Other
    }
}

/// Returns a failure with one line for each missing or different node, or if no node responds.
fn conclude(
    checked: &[(&NodeReport, Verdict)],
    missing: &[&NodePlan],
    has_polled: bool,
) -> Result<(), Failure> {
    let remedy = if has_polled { "" } else { "; if it may be NMT-stopped, scan with --stopped" };
    let absent = missing
        .iter()
        .map(|plan| format!("{}, node {}: does not respond{remedy}", plan.name, plan.node.raw()));
    let wrong = checked.iter().filter_map(|(found, verdict)| {
        let reason = match verdict {
            Verdict::Other => "its identity differs from the configuration",
            Verdict::Mute if found.state == Some(NmtState::Stopped) => {
                "is NMT-stopped and responds to no SDO request until `frhc nmt preop`"
            }
            Verdict::Mute => "reports its state, but does not respond to SDO requests",
            Verdict::Unchecked | Verdict::Expected | Verdict::Unexpected => return None,
        };
        Some(format!("node {}: {reason}", found.node.raw()))
    });
    let problems: Vec<String> = absent.chain(wrong).collect();
    if !problems.is_empty() {
        Err(Failure::new(Kind::Drive, problems.join("\n")))
    } else if checked.iter().any(|(found, _)| found.answers) {
        Ok(())
    } else {
        let received = match checked.len() {
            0 => "no heartbeat was received".to_owned(),
            1 => "the state of one was received".to_owned(),
            count => format!("the states of {count} were received"),
        };
        Err(Failure::new(Kind::Negative, format!("no node responds; {received}")))
    }
}

impl Verdict {
    const fn description(self) -> &'static str {
        match self {
            Self::Unchecked => "",
            Self::Expected => "as configured",
            Self::Other => "another device",
            Self::Mute => "does not answer",
            Self::Unexpected => "unexpected",
        }
    }
}

fn table(checked: &[(&NodeReport, Verdict)], plans: Option<&[NodePlan]>) {
    if checked.is_empty() {
        return;
    }
    print::line("node state           profile vendor   product  revision serial   name");
    for (found, verdict) in checked {
        let number = |number: Option<u32>| number.map_or("-".to_owned(), |n| format!("{n:08X}"));
        let profile = found.device_type.map(|kind| (kind & 0xFFFF).to_string());
        let plan = plans.iter().copied().flatten().find(|plan| plan.node == found.node);
        let mut line = format!(
            "{:>4} {:<15} {:>7} {:<8} {:<8} {:<8} {:<8} {}",
            found.node.raw(),
            found.state.map_or("-", nmt::description),
            profile.as_deref().unwrap_or("-"),
            number(found.vendor),
            number(found.product),
            number(found.revision),
            number(found.serial),
            found.name.as_deref().unwrap_or("-"),
        );
        let expected = plan.map(|plan| format!(", {}", plan.name)).unwrap_or_default();
        if *verdict != Verdict::Unchecked {
            line.push_str(&format!(" ({}{expected})", verdict.description()));
        }
        if let Some(emergency) = found.emergency {
            line.push_str(&format!(" EMCY {emergency}"));
        }
        print::line(&line);
    }
}

fn json(
    interface: &str,
    checked: &[(&NodeReport, Verdict)],
    missing: &[&NodePlan],
    pdos: &[Pdos],
) -> serde_json::Value {
    let pdos_of = |node: NodeId| {
        let (_, pdos) = pdos.iter().find(|(of, _)| *of == node)?;
        pdos.as_ref().ok().map(|pdos| pdos.iter().map(pdos::json).collect::<Vec<_>>())
    };
    let nodes = checked.iter().map(|(found, verdict)| {
        serde_json::json!({
            "node": found.node.raw(),
            "answers": found.answers,
            "state": found.state.map(nmt::description),
            "device_type": found.device_type,
            "profile": found.device_type.map(|kind| kind & 0xFFFF),
            "vendor": found.vendor,
            "product": found.product,
            "revision": found.revision,
            "serial": found.serial,
            "name": found.name,
            "hardware": found.hardware,
            "software": found.software,
            "emergency": found.emergency.map(|emergency| emergency.to_string()),
            "double": found.is_duplicate(),
            "pdos": pdos_of(found.node),
            "verdict": (*verdict != Verdict::Unchecked).then(|| verdict.description()),
        })
    });
    let missing = missing
        .iter()
        .map(|plan| serde_json::json!({ "node": plan.node.raw(), "name": plan.name }));
    serde_json::json!({
        "interface": interface,
        "nodes": nodes.collect::<Vec<_>>(),
        "missing": missing.collect::<Vec<_>>(),
    })
}
