//! `frhc nmt`: NMT commands to one node or all of them, and their heartbeats.

use std::time::Duration;

use clap::{Args, Subcommand};

use crate::live_bus::{BusArgs, ForceArg, NodeArg, SessionError, node_arg};
use canopen::nmt::{self, Order};
use canopen::{NmtCommand, NmtState, NodeId, heartbeat};
use canopen_tools::diagnostics::beats::Beat;
use canopen_tools::diagnostics::confirm::{Confirmation, NodeResponse};
use canopen_tools::diagnostics::network_monitor::{NetworkEvent, NetworkMonitor};
use run::exit::{Failure, Kind};
use run::print;
use units::time::Instant;

/// `frhc nmt`.
#[derive(Debug, Args)]
#[command(
    after_help = "NMT commands are unconfirmed. --wait waits for the boot-up message after a reset, otherwise for a \
        heartbeat with the new state, which only nodes with a producer heartbeat time (1017h) send.\n\n\
        Commands are refused while a master sends SYNC, unless --force is given: a running node detects a second \
        master and stops.\n\n\
        Examples:\n  frhc nmt start 3 --wait -i can0\n  frhc nmt reset all --config config/kraft_like.toml --wait\n  \
        frhc nmt watch -i can0"
)]
pub struct Nmt {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    bus: BusArgs,
}

#[derive(Clone, Debug, Subcommand)]
enum Task {
    /// Start remote node: enter operational.
    Start(Command),
    /// Stop remote node: enter stopped.
    Stop(Command),
    /// Enter pre-operational.
    Preop(Command),
    /// Reset node: application and communication.
    Reset(Command),
    /// Reset communication only.
    ResetComm(Command),
    /// Shows boot-ups, state changes, lost heartbeats and emergencies until Ctrl-C.
    #[command(after_help = "Example:\n  frhc nmt watch --seconds 10 --json -i can0 | jq .news")]
    Watch(WatchArgs),
}

/// An NMT command to one node or all nodes.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Example, as for start:\n  frhc nmt start 3 --wait -i can0")]
struct Command {
    /// Node-id 1 to 127, decimal or as 0x10, or all; with a configuration also the name of a joint.
    #[arg(value_name = "NODE|all", value_parser = node_arg::node_or_all)]
    node: Node,
    /// Wait for confirmation and exit with 5 if it is missing. `all` waits for the nodes of the configuration, or
    /// without one for any node.
    #[arg(short, long)]
    wait: bool,
    /// Time to wait for confirmation.
    #[arg(long, value_name = "MS", default_value_t = 2_000, requires = "wait",
        value_parser = clap::value_parser!(u64).range(1..=600_000))]
    timeout: u64,
    /// Print each confirmation as one JSON object per line.
    #[arg(long, requires = "wait")]
    json: bool,
    #[command(flatten)]
    force: ForceArg,
}

/// `frhc nmt watch`.
#[derive(Clone, Copy, Debug, Args)]
struct WatchArgs {
    /// End after this many seconds.
    #[arg(long, value_name = "N", value_parser = demo::parsers::seconds, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Time without heartbeat after which a node is reported lost.
    #[arg(long, value_name = "MS", default_value_t = 2_000,
        value_parser = clap::value_parser!(u64).range(1..=600_000))]
    timeout: u64,
    /// Print each event as one JSON object per line.
    #[arg(long)]
    json: bool,
}

/// Node, or `None` for all. With the alias clap does not treat the argument as optional.
type Node = Option<NodeArg>;

/// Sends the command and, with `--wait`, waits for its confirmation.
pub(super) fn run(args: &Nmt) -> Result<(), Failure> {
    let (command, to) = match &args.task {
        Task::Start(to) => (NmtCommand::StartRemoteNode, to),
        Task::Stop(to) => (NmtCommand::StopRemoteNode, to),
        Task::Preop(to) => (NmtCommand::EnterPreOperational, to),
        Task::Reset(to) => (NmtCommand::ResetNode, to),
        Task::ResetComm(to) => (NmtCommand::ResetCommunication, to),
        Task::Watch(options) => return watch(&args.bus, *options),
    };
    let Command { node, wait, timeout, json, force } = to;
    let bus = args.bus.select_for(node)?;
    let node = node.as_ref().map(|node| bus.node(node)).transpose()?;
    let order = Order { command, node };
    let named: Vec<NodeId> = match node {
        Some(node) => vec![node],
        None => bus.plans().iter().flatten().map(|plan| plan.node).collect(),
    };
    let (mut session, beats) = bus.open_listening(*force)?;
    if !wait {
        return session.send([order.frame()]).map_err(|error| bus.fail(error));
    }
    let within = Duration::from_millis(*timeout);
    let confirmations = session
        .run(|now, out| Confirmation::start(order, &named, within, now, out).after(beats))
        .map_err(|error| bus.fail(error))?;
    for confirmation in confirmations.iter().filter(|it| it.is_confirmed) {
        show(*json, confirmation);
    }
    conclude(&confirmations, *timeout, session.now())
}

/// Returns a failure with one line for each node that has not confirmed.
fn conclude(confirmations: &[NodeResponse], timeout: u64, now: Instant) -> Result<(), Failure> {
    let failed = confirmations.iter().filter(|it| !it.is_confirmed).map(|it| {
        let last = last_received(it, now);
        format!("node {}: not confirmed within {timeout} ms: {last}", it.node.raw())
    });
    let failed: Vec<String> = failed.collect();
    match (confirmations.is_empty(), failed.is_empty()) {
        (true, _) => {
            let reason =
                format!("not confirmed within {timeout} ms: no heartbeat or boot-up received");
            Err(Failure::new(Kind::Drive, reason))
        }
        (false, true) => Ok(()),
        (false, false) => Err(Failure::new(Kind::Drive, failed.join("\n"))),
    }
}

/// Describes what was received last from a node, and when.
fn last_received(response: &NodeResponse, now: Instant) -> String {
    let ago = |beat: Beat| format!("{:.1} s ago", now.since(beat.at).as_secs_f64());
    match (response.state, response.last) {
        (_, Some(last @ Beat { interval: Some(interval), .. })) if last.is_overdue(now) => {
            let (ago, ms) = (ago(last), interval.as_millis());
            let state = state_name(last.state);
            format!("its heartbeats, every {ms} ms, ended {ago}; the last was {state}")
        }
        (Some(state), _) => format!("its state is {}", nmt::description(state)),
        (None, Some(last)) => {
            let (ago, state) = (ago(last), state_name(last.state));
            format!("no frame received since the command; its last heartbeat, {ago}, was {state}")
        }
        (None, None) => "no frame received; its heartbeat may be off (1017h)".to_owned(),
    }
}

fn show(json: bool, confirmation: &NodeResponse) {
    let state = confirmation.state.map(state_name);
    if json {
        let report = serde_json::json!({ "node": confirmation.node.raw(), "state": state });
        print::line(&report.to_string());
    } else {
        print::line(&format!("node {} {}", confirmation.node.raw(), state.unwrap_or("-")));
    }
}

/// Returns the name of a state. State 0 is the boot-up message, after which a node is pre-operational.
const fn state_name(state: NmtState) -> &'static str {
    match state {
        NmtState::Initialising => "booted up",
        NmtState::Stopped | NmtState::Operational | NmtState::PreOperational => {
            nmt::description(state)
        }
    }
}

/// Prints events until interrupted.
fn watch(bus: &BusArgs, options: WatchArgs) -> Result<(), Failure> {
    let bus = bus.select()?;
    let mut session = bus.open()?;
    let end = options.seconds.map(|seconds| session.now() + Duration::from_secs_f64(seconds));
    let mut monitor = NetworkMonitor::new(Duration::from_millis(options.timeout), end);
    // Ends when stdout is closed, too.
    while !print::has_failed() {
        match session.resume(&mut monitor) {
            Ok(Some((at, news))) => print_event(options.json, at, news),
            Ok(None) | Err(SessionError::Interrupted) => return Ok(()),
            Err(error) => return Err(bus.fail(error)),
        }
    }
    Ok(())
}

/// Prints an event as `12.345678 node 3 operational`: seconds since the start.
fn print_event(json: bool, at: Instant, news: NetworkEvent) {
    let (node, what) = match news {
        NetworkEvent::Heartbeat(node, news) => (
            node,
            match news {
                heartbeat::HeartbeatEvent::State(state) => nmt::description(state).to_owned(),
                heartbeat::HeartbeatEvent::BootedUp => "booted up".to_owned(),
                heartbeat::HeartbeatEvent::Rebooted => "booted up again".to_owned(),
                heartbeat::HeartbeatEvent::Lost => "heartbeat lost".to_owned(),
                heartbeat::HeartbeatEvent::Duplicate(sign) => format!("duplicate node-id: {sign}"),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Words about a node that sent its last heartbeat at 1 s, seen at 3 s.
    fn words(state: Option<NmtState>, interval_ms: Option<u64>) -> String {
        let node = NodeId::new(3).unwrap();
        let at = Instant::from_micros(1_000_000);
        let interval = interval_ms.map(Duration::from_millis);
        let last = Some(Beat { node, state: NmtState::PreOperational, at, interval });
        let response = NodeResponse { node, state, last, is_confirmed: false };
        let failure = conclude(&[response], 2_000, Instant::from_micros(3_000_000)).unwrap_err();
        failure.to_string()
    }

    #[test]
    fn node_that_died_differs_from_one_without_heartbeat() {
        let state = Some(NmtState::PreOperational);
        let head = "node 3: not confirmed within 2000 ms: ";
        let died = "its heartbeats, every 100 ms, ended 2.0 s ago; the last was pre-operational";
        assert_eq!(words(state, Some(100)), format!("{head}{died}"));
        assert_eq!(words(None, Some(100)), format!("{head}{died}"));
        let once = "no frame received since the command; its last heartbeat, 2.0 s ago, was pre-operational";
        assert_eq!(words(None, None), format!("{head}{once}"));
        assert_eq!(words(state, Some(1_000)), format!("{head}its state is pre-operational"));
    }
}
