//! `frhc run`: the node on SocketCAN. One thread runs the cycle and nothing else, one writes its
//! records, one its messages, one reads signals, and this one serves the console.

use std::path::Path;
use std::sync::Arc;
use std::thread;

use anyhow::Context;
use tokio::sync::oneshot;

use crate::bus::Bus;
use crate::bus::Traced;
use crate::bus::realtime;
use crate::cli::archive;
use crate::cli::archive::Archive;
use crate::cli::args::Run;
use crate::cli::commission;
use crate::cli::console;
use crate::cli::console::Desk;
use crate::cli::console::Due;
use crate::cli::console::Inbox;
use crate::cli::console::Socket;
use crate::cli::console::default_socket;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::gains;
use crate::cli::interfaces;
use crate::cli::keeper::Keeper;
use crate::cli::latch::Latch;
use crate::cli::orders::Orders;
use crate::cli::print;
use crate::cli::provenance::Provenance;
use crate::cli::recorder;
use crate::cli::recorder::Latest;
use crate::cli::rings;
use crate::cli::rings::Offer;
use crate::cli::session;
use crate::cli::time_line;
use crate::lab::site::VirtualSite;
use crate::node::BringUpError;
use crate::node::Node;
use crate::node::Request;
use crate::remote::Remote;
use crate::telemetry::origin::Origin;

/// Runs the node until a signal ends it.
pub(super) fn run(args: &Run) -> Result<(), Failure> {
    let orders = Orders::start().context("no signals").or_fail(Kind::Bus)?;
    let config = args.config.load()?;
    gains::warn(&config);
    commission::warn(&config);
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("no runtime").or_fail(Kind::Bus)?;
    let path = config.socket.clone().unwrap_or_else(default_socket);
    let socket = runtime.block_on(Socket::bind(path.clone()));
    let socket = socket.with_context(|| format!("control socket {}", path.display()));
    let socket = socket.or_fail(Kind::Bus)?;

    let bus = interfaces::open(&config, &names)?;
    time_line::start(bus.clock());
    tracing::info!("time counts from {}", Origin::from_micros(bus.epoch_micros()));
    let clock = bus.clock();
    let origin = Origin::from_micros(bus.epoch_micros());
    let keeper = keep(args.record.as_deref(), &Provenance::of(&config, &names, origin))?;

    let (offer, entries, lost) = rings::rings();
    let mut archive = Archive::of(keeper, lost.clone()).or_fail(Kind::Bus)?;
    let node = Node::new(&config, Traced::new(bus, offer), VirtualSite::new(&config));
    let (requests, inbox) = console::channel();
    let (ended, end) = oneshot::channel();
    let latest = Latest::default();
    let latch = Latch::set(&names);
    let remark = latch.remark().map(str::to_owned);
    remark.iter().for_each(|remark| tracing::warn!("{remark}"));
    let desk = Arc::new(Desk::new(requests, latest.clone(), clock, remark));
    orders.become_orderly();

    let (outcome, mut summary) = thread::scope(|threads| -> Result<_, Failure> {
        let (archived, shown) = (&mut archive, latest);
        let names: Vec<_> = config.node_plans().into_iter().map(|(_, plan)| plan.name).collect();
        let recording = thread::Builder::new()
            .name("frhc-recorder".to_owned())
            .stack_size(archive::STACK)
            .spawn_scoped(threads, move || {
                recorder::record(entries, archived, &shown, &names, &lost)
            })
            .context("no thread for the recorder")
            .or_fail(Kind::Bus)?;
        let orders = &orders;
        let cycle = move || {
            let outcome = attend(node, inbox, orders, latch);
            // The main thread may have gone before.
            ended.send(outcome).ok();
        };
        thread::Builder::new()
            .name("frhc-cycle".to_owned())
            .spawn_scoped(threads, cycle)
            .context("no thread for the cycle")
            .or_fail(Kind::Bus)?;
        let outcome = runtime.block_on(serve(&socket, &desk, end));
        let summary = recording.join();
        let summary = summary.map_err(|_| Failure::new(Kind::Bus, "the recorder failed"))?;
        Ok((outcome, summary))
    })?;
    summary.origin = origin;
    let (left, finished) = archive.finish(&summary);
    if summary.cycles > 0 {
        print::note(&summary.to_string());
    }
    left.iter().for_each(|line| print::note(line));
    outcome.and(finished.or_fail(Kind::Bus))
}

/// What is kept of the run: fault records and, in a numbered folder below `parent`, a session.
fn keep(parent: Option<&Path>, provenance: &Provenance) -> Result<Keeper, Failure> {
    let Some(parent) = parent else { return Ok(Keeper::of_faults_alone(provenance)) };
    let folder = session::numbered(parent, provenance.origin).or_fail(Kind::Bus)?;
    tracing::info!("recording in {}", folder.display());
    Keeper::of_session(&folder, provenance).or_fail(Kind::Bus)
}

/// Serves the console until the cycle's thread has ended.
async fn serve(
    socket: &Socket,
    desk: &Arc<Desk>,
    end: oneshot::Receiver<Result<(), Failure>>,
) -> Result<(), Failure> {
    let failed = || Err(Failure::new(Kind::Bus, "the cycle failed"));
    tokio::select! {
        outcome = end => outcome.unwrap_or_else(|_| failed()),
        () = socket.serve(desk) => failed(),
    }
}

/// End of the cycle's thread.
struct Ended {
    /// Whether every drive is known to be off, and no stop is latched.
    is_orderly: bool,
    outcome: Result<(), Failure>,
}

impl Ended {
    fn of(is_orderly: bool, outcome: Result<(), Failure>) -> Self {
        Self { is_orderly, outcome }
    }
}

/// The cycle's thread: bring-up, cycles, stop. The latch goes if all of it was in order.
fn attend<B: Bus, R: Remote>(
    mut node: Node<Traced<B, Offer>, R>,
    mut inbox: Inbox,
    orders: &Orders,
    mut latch: Latch,
) -> Result<(), Failure> {
    let granted = realtime::ask();
    tracing::info!(%granted, "priority");
    let Ended { is_orderly, outcome } = live(&mut node, &mut inbox, orders, &mut latch);
    let reason = || outcome.as_ref().err().map_or_else(String::new, ToString::to_string);
    let left = latch.end(if is_orderly { Ok(()) } else { Err(reason()) });
    left.iter().for_each(|line| tracing::warn!("{line}"));
    outcome
}

fn live<B: Bus, R: Remote>(
    node: &mut Node<Traced<B, Offer>, R>,
    inbox: &mut Inbox,
    orders: &Orders,
    latch: &mut Latch,
) -> Ended {
    let stopping = || orders.stopping();
    let mut give_up = || {
        inbox.attend_boot();
        stopping()
    };
    let booted = match latch.cause() {
        None => node.bring_up(&mut give_up),
        Some(cause) => node.bring_up_unpowered(cause, &mut give_up),
    };
    pass_on(node);
    match booted {
        Ok(()) if latch.cause().is_some() => {
            tracing::warn!("waiting for a reset: no drive is enabled");
        }
        Ok(()) => tracing::info!("ready: all drives enabled at zero torque"),
        Err(error) => return not_booted(node, error),
    }
    inbox.booted(node.bus().now());
    while !stopping() {
        grant(node, inbox, latch, &stopping);
        cycle(node);
        pass_on(node);
    }
    inbox.end();
    let stopped_by = node.cause();
    let stop = |reason| Failure::new(Kind::Stopped, reason);
    match (stopped_by, node.stop()) {
        (None, confirmed) => Ended::of(confirmed.is_ok(), confirmed.or_fail(Kind::Drive)),
        (Some(cause), Ok(())) => Ended::of(false, Err(stop(format!("stopped by {cause}")))),
        (Some(cause), Err(error)) => {
            Ended::of(false, Err(stop(format!("stopped by {cause}; {error}"))))
        }
    }
}

/// A boot that failed. Where it did before a drive was enabled, there is nothing to latch.
fn not_booted<B: Bus, R: Remote>(
    node: &mut Node<Traced<B, Offer>, R>,
    error: BringUpError,
) -> Ended {
    match error {
        BringUpError::GivenUp => Ended::of(true, Ok(())),
        BringUpError::Bus(_) | BringUpError::Unfit(_) => {
            Ended::of(true, Err(error).or_fail(Kind::Bus))
        }
        BringUpError::Boot(_) => Ended::of(true, Err(error).or_fail(Kind::Drive)),
        BringUpError::NotProven(_) => Ended::of(node.is_off(), Err(error).or_fail(Kind::Drive)),
        BringUpError::LeftOn(_) => Ended::of(false, Err(error).or_fail(Kind::Drive)),
        BringUpError::NotEnabled(_) => {
            // A trip like any other: it is recorded.
            cycle(node);
            Ended::of(false, Err(error).or_fail(Kind::Drive))
        }
    }
}

/// One cycle, recorded.
fn cycle<B: Bus, R: Remote>(node: &mut Node<Traced<B, Offer>, R>) {
    let record = node.cycle();
    node.bus_mut().tap_mut().record(&record);
}

/// Does what was asked for: a disarm, and one other request.
fn grant<B: Bus, R: Remote>(
    node: &mut Node<B, R>,
    inbox: &mut Inbox,
    latch: &mut Latch,
    stopping: &impl Fn() -> bool,
) {
    if let Some(disarm) = inbox.disarm() {
        // A disarm is never refused.
        let mode = node.request(Request::Disarm, &mut || false).unwrap_or(node.mode());
        inbox.disarmed(disarm, mode);
    }
    let Some(due) = inbox.next(node.bus().now()) else { return };
    let Due { request, .. } = due;
    let mut has_booted = false;
    if request == Request::Reset {
        latch.before_reset();
    }
    let outcome = node.request(request, &mut || {
        has_booted = true;
        inbox.boots();
        inbox.attend_boot();
        stopping()
    });
    if has_booted {
        inbox.booted(node.bus().now());
    }
    if request == Request::Reset && outcome.is_ok() {
        latch.release();
    }
    due.answer(outcome);
}

/// What has happened on the network goes to whoever writes messages.
fn pass_on<B: Bus, R: Remote>(node: &mut Node<Traced<B, Offer>, R>) {
    while let Some(event) = node.notice() {
        node.bus_mut().tap_mut().event(event);
    }
}
