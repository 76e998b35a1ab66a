//! `frhc scan`: who is on the bus, and who should be.

mod pdos;

use std::time::Duration;

use clap::Args;

use crate::cli::bench::Line;
use crate::cli::bench::words;
use crate::cli::scan::pdos::Pdos;
use canopen::NodeId;
use canopen::nmt;
use canopen::plan::NodePlan;
use canopen_tools::diagnostics::scan::Found;
use run::exit::Failure;
use run::exit::Kind;
use run::print;

/// `frhc scan`.
#[derive(Debug, Args)]
#[command(
    after_help = "It reads 1000h, 1018h, 1008h, 1009h and 100Ah, and writes nothing. But a node serves one master's \
        transfer at a time: do not scan while another master configures its nodes.\n\n\
        With a configuration it also says who is missing (exit 5), who is another device (exit 5), and who is \
        not expected. The exit code is 1 when no node answers and none is expected.\n\n\
        Examples:\n  frhc scan -i can0\n  frhc scan --config config/kraft_like.toml --pdos\n  \
        frhc scan --config config/kraft_like.toml --json | jq .nodes"
)]
pub(crate) struct Scan {
    #[command(flatten)]
    line: Line,
    /// Whom to ask, as 1-16,32.
    #[arg(long, value_name = "LIST", default_value = "1-127", value_parser = words::nodes)]
    nodes: Nodes,
    /// How long a node has for each answer.
    #[arg(long, value_name = "MS", default_value_t = 100,
        value_parser = clap::value_parser!(u64).range(1..=60_000))]
    timeout: u64,
    /// How long to listen for heartbeats at least.
    #[arg(long, value_name = "MS", default_value_t = 250)]
    listen: u64,
    /// Read the PDOs of every node that answers, too: what it really has, whatever was planned.
    #[arg(long)]
    pdos: bool,
    /// The findings as one JSON object.
    #[arg(long)]
    json: bool,
}

/// What clap takes for one value, not for several.
type Nodes = Vec<NodeId>;

/// What the configuration says of a node that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// There is no configuration.
    Unjudged,
    /// It is who it should be.
    Expected,
    /// It is there, and somebody else.
    Other,
    /// It is there, and does not answer.
    Mute,
    /// Nobody expects it.
    Unexpected,
}

/// Scans, and prints what was found.
pub(super) fn run(args: &Scan) -> Result<(), Failure> {
    let known = args.line.find()?;
    let plans = known.plans();
    let master = known.configured.as_ref().map(|(config, _)| config.node_id);
    let mut session = known.open()?;
    let (timeout, listen) =
        (Duration::from_millis(args.timeout), Duration::from_millis(args.listen));
    let found = session
        .run(|now, out| {
            canopen_tools::diagnostics::scan::Scan::start(&args.nodes, timeout, listen, now, out)
        })
        .map_err(|error| known.fail(error))?;
    // Heartbeats tell of nodes that nobody asked about, too.
    let asked = found.iter().filter(|found| args.nodes.contains(&found.node));
    let judged: Vec<(&Found, Verdict)> =
        asked.map(|found| (found, judge(found, plans.as_deref(), master))).collect();
    let missing: Vec<&NodePlan> = plans
        .iter()
        .flatten()
        .filter(|plan| args.nodes.contains(&plan.node))
        .filter(|plan| !found.iter().any(|found| found.node == plan.node))
        .collect();
    let answering = found.iter().filter(|found| args.pdos && found.answers);
    let pdos = pdos::read(&mut session, answering.map(|found| found.node), timeout)
        .map_err(|error| known.fail(error))?;
    if args.json {
        print::line(&json(&known.interface, &judged, &missing, &pdos).to_string());
    } else {
        table(&judged, plans.as_deref());
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
        let why = if found.is_answered_twice { "answered twice" } else { "booted up twice" };
        print::note(&format!("node {}: {why}: two nodes may share this node-id", found.node.raw()));
    }
    conclude(&judged, &missing)
}

/// Who it is, by the configuration; the master itself is nobody's surprise.
fn judge(found: &Found, plans: Option<&[NodePlan]>, master: Option<NodeId>) -> Verdict {
    let Some(plans) = plans else { return Verdict::Unjudged };
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

/// Nothing, or one line for each node that is missing or another, or one for all where none answers.
fn conclude(judged: &[(&Found, Verdict)], missing: &[&NodePlan]) -> Result<(), Failure> {
    let absent = missing
        .iter()
        .map(|plan| format!("{}, node {}: does not answer", plan.name, plan.node.raw()));
    let wrong = judged.iter().filter_map(|(found, verdict)| {
        let reason = match verdict {
            Verdict::Other => "is another device than configured",
            Verdict::Mute => "is heard, and does not answer",
            Verdict::Unjudged | Verdict::Expected | Verdict::Unexpected => return None,
        };
        Some(format!("node {}: {reason}", found.node.raw()))
    });
    let problems: Vec<String> = absent.chain(wrong).collect();
    if !problems.is_empty() {
        Err(Failure::new(Kind::Drive, problems.join("\n")))
    } else if judged.iter().any(|(found, _)| found.answers) {
        Ok(())
    } else {
        let received = match judged.len() {
            0 => "no heartbeat is received".to_owned(),
            1 => "the heartbeat of one is received".to_owned(),
            count => format!("the heartbeats of {count} are received"),
        };
        Err(Failure::new(Kind::Negative, format!("no node answers; {received}")))
    }
}

impl Verdict {
    const fn description(self) -> &'static str {
        match self {
            Self::Unjudged => "",
            Self::Expected => "as configured",
            Self::Other => "another device",
            Self::Mute => "does not answer",
            Self::Unexpected => "unexpected",
        }
    }
}

fn table(judged: &[(&Found, Verdict)], plans: Option<&[NodePlan]>) {
    if judged.is_empty() {
        return;
    }
    print::line("node state           profile vendor   product  revision serial   name");
    for (found, verdict) in judged {
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
        if *verdict != Verdict::Unjudged {
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
    judged: &[(&Found, Verdict)],
    missing: &[&NodePlan],
    pdos: &[Pdos],
) -> serde_json::Value {
    let pdos_of = |node: NodeId| {
        let (_, pdos) = pdos.iter().find(|(of, _)| *of == node)?;
        pdos.as_ref().ok().map(|pdos| pdos.iter().map(pdos::json).collect::<Vec<_>>())
    };
    let nodes = judged.iter().map(|(found, verdict)| {
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
            "verdict": (*verdict != Verdict::Unjudged).then(|| verdict.description()),
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
