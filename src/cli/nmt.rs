//! `frhc nmt`: commands to one node or all of them, and what their heartbeats say.

use std::time::Duration;

use clap::Args;
use clap::Subcommand;

use crate::cli::bench::Beside;
use crate::cli::bench::Line;
use crate::cli::bench::SessionError;
use crate::cli::bench::words;
use canopen::NmtCommand;
use canopen::NmtState;
use canopen::NodeId;
use canopen::heartbeat;
use canopen::nmt;
use canopen::nmt::Order;
use canopen_tools::diagnostics::confirm::Confirmation;
use canopen_tools::diagnostics::confirm::NodeResponse;
use canopen_tools::diagnostics::watch::NetworkEvent;
use canopen_tools::diagnostics::watch::Watch;
use run::exit::Failure;
use run::exit::Kind;
use run::print;
use units::time::Instant;

/// `frhc nmt`.
#[derive(Debug, Args)]
#[command(
    after_help = "NMT is never answered. --wait waits for what confirms it: the boot-up after a reset, otherwise \
        the next heartbeat, which only nodes with a heartbeat time (1017h) send.\n\n\
        Commands are refused while SYNCs are received, unless forced: a node that runs takes one for another \
        master, and stops.\n\n\
        Examples:\n  frhc nmt start 3 --wait -i can0\n  frhc nmt reset all --config config/kraft_like.toml --wait\n  \
        frhc nmt watch -i can0"
)]
pub(crate) struct Nmt {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    line: Line,
}

#[derive(Clone, Copy, Debug, Subcommand)]
enum Task {
    /// To operational.
    Start(Command),
    /// To stopped.
    Stop(Command),
    /// To pre-operational.
    Preop(Command),
    /// Reset the whole node.
    Reset(Command),
    /// Reset its communication only.
    ResetComm(Command),
    /// Boot-ups, changes of state, silences and emergencies, until Ctrl-C.
    #[command(after_help = "Example:\n  frhc nmt watch --seconds 10 --json -i can0 | jq .news")]
    Watch(Watching),
}

/// A command to a node or to all of them.
#[derive(Clone, Copy, Debug, Args)]
#[command(after_help = "Example, as for start:\n  frhc nmt start 3 --wait -i can0")]
struct Command {
    /// The node, 1 to 127, in decimal or as 0x10; or all.
    #[arg(value_name = "NODE|all", value_parser = words::node_or_all)]
    node: Node,
    /// Wait until every node is heard to have obeyed (exit 5 if not): the node, or for `all` the nodes of the
    /// configuration, or whoever is heard.
    #[arg(short, long)]
    wait: bool,
    /// How long to wait.
    #[arg(long, value_name = "MS", default_value_t = 2_000, requires = "wait",
        value_parser = clap::value_parser!(u64).range(1..=600_000))]
    timeout: u64,
    /// What is heard as one JSON object per line.
    #[arg(long, requires = "wait")]
    json: bool,
    #[command(flatten)]
    force: Beside,
}

/// `frhc nmt watch`.
#[derive(Clone, Copy, Debug, Args)]
struct Watching {
    /// End after so many seconds.
    #[arg(long, value_name = "N", value_parser = words::seconds, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// How long a watched node may be silent.
    #[arg(long, value_name = "MS", default_value_t = 2_000,
        value_parser = clap::value_parser!(u64).range(1..=600_000))]
    timeout: u64,
    /// What is heard as one JSON object per line.
    #[arg(long)]
    json: bool,
}

/// A node, or all: as words say it, and not as an argument that may be left out.
type Node = Option<NodeId>;

/// Sends the command, and waits for what confirms it.
pub(super) fn run(args: &Nmt) -> Result<(), Failure> {
    let (command, to) = match args.task {
        Task::Start(to) => (NmtCommand::StartRemoteNode, to),
        Task::Stop(to) => (NmtCommand::StopRemoteNode, to),
        Task::Preop(to) => (NmtCommand::EnterPreOperational, to),
        Task::Reset(to) => (NmtCommand::ResetNode, to),
        Task::ResetComm(to) => (NmtCommand::ResetCommunication, to),
        Task::Watch(watching) => return watch(&args.line, watching),
    };
    let Command { node, wait, timeout, json, force } = to;
    let known = args.line.find()?;
    let order = Order { command, node };
    let named: Vec<NodeId> = match node {
        Some(node) => vec![node],
        None => known.plans().iter().flatten().map(|plan| plan.node).collect(),
    };
    let mut session = known.open_to_command(force)?;
    if !wait {
        return session.say([order.frame()]).map_err(|error| known.fail(error));
    }
    let within = Duration::from_millis(timeout);
    let responses = session
        .run(|now, out| Confirmation::start(order, &named, within, now, out))
        .map_err(|error| known.fail(error))?;
    for response in responses.iter().filter(|response| response.is_confirmed) {
        show(json, response);
    }
    conclude(&responses, timeout)
}

/// Nothing, or one line for each node that was not heard to obey.
fn conclude(responses: &[NodeResponse], timeout: u64) -> Result<(), Failure> {
    let failed = responses.iter().filter(|response| !response.is_confirmed).map(|response| {
        let last = response.state.map_or_else(
            || "no heartbeat was received; the producer heartbeat time may be 0 (1017h)".to_owned(),
            |state| format!("it is {}", nmt::description(state)),
        );
        format!("node {}: not confirmed within {timeout} ms: {last}", response.node.raw())
    });
    let failed: Vec<String> = failed.collect();
    match (responses.is_empty(), failed.is_empty()) {
        (true, _) => {
            let reason = format!("not confirmed within {timeout} ms: no node sent a heartbeat");
            Err(Failure::new(Kind::Drive, reason))
        }
        (false, true) => Ok(()),
        (false, false) => Err(Failure::new(Kind::Drive, failed.join("\n"))),
    }
}

fn show(json: bool, response: &NodeResponse) {
    let state = response.state.map(words_of);
    if json {
        let report = serde_json::json!({ "node": response.node.raw(), "state": state });
        print::line(&report.to_string());
    } else {
        print::line(&format!("node {} {}", response.node.raw(), state.unwrap_or("-")));
    }
}

/// A node that has just booted says so, and is pre-operational.
const fn words_of(state: NmtState) -> &'static str {
    match state {
        NmtState::Initialising => "booted up",
        NmtState::Stopped | NmtState::Operational | NmtState::PreOperational => {
            nmt::description(state)
        }
    }
}

/// Prints what is heard until it is interrupted.
fn watch(line: &Line, watching: Watching) -> Result<(), Failure> {
    let known = line.find()?;
    let mut session = known.open()?;
    let end = watching.seconds.map(|seconds| session.now() + Duration::from_secs_f64(seconds));
    let mut watch = Watch::new(Duration::from_millis(watching.timeout), end);
    // A reader that hung up ends it, too.
    while !print::is_over() {
        match session.carry(&mut watch) {
            Ok(Some((at, news))) => tell(watching.json, at, news),
            Ok(None) | Err(SessionError::Interrupted) => return Ok(()),
            Err(error) => return Err(known.fail(error)),
        }
    }
    Ok(())
}

/// `12.345678 node 3 operational`: seconds since it began to listen.
fn tell(json: bool, at: Instant, news: NetworkEvent) {
    let (node, what) = match news {
        NetworkEvent::Heartbeat(node, news) => (
            node,
            match news {
                heartbeat::HeartbeatEvent::State(state) => nmt::description(state).to_owned(),
                heartbeat::HeartbeatEvent::BootedUp => "booted up".to_owned(),
                heartbeat::HeartbeatEvent::Rebooted => "booted up again".to_owned(),
                heartbeat::HeartbeatEvent::Lost => "silent".to_owned(),
                heartbeat::HeartbeatEvent::Duplicate(sign) => {
                    format!("two nodes of this node-id: {sign}")
                }
            },
        ),
        NetworkEvent::Emergency(node, emergency) => (node, format!("EMCY {emergency}")),
    };
    let seconds = Duration::from_micros(at.as_micros()).as_secs_f64();
    if json {
        let report = serde_json::json!({ "seconds": seconds, "node": node.raw(), "news": what });
        print::line(&report.to_string());
    } else {
        print::line(&format!("{seconds:.6} node {} {what}", node.raw()));
    }
}
