//! `frhc run`: the node on SocketCAN. One thread runs the cycle and nothing else, one writes its
//! records, one its messages, and this one serves the console and waits for signals.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

use anyhow::Context;
use tokio::sync::mpsc;
use tokio::sync::oneshot;

use crate::bus::Bus;
use crate::bus::SocketCan;
use crate::bus::Traced;
use crate::bus::interface;
use crate::bus::realtime;
use crate::cli::args::Run;
use crate::cli::commission;
use crate::cli::console::Pending;
use crate::cli::console::Socket;
use crate::cli::console::default_socket;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::gains;
use crate::cli::interfaces;
use crate::cli::keeper::Keeper;
use crate::cli::print;
use crate::cli::recorder;
use crate::cli::recorder::Latest;
use crate::cli::recorder::Offer;
use crate::cli::signals::Order;
use crate::cli::signals::Orders;
use crate::config::Config;
use crate::lab::site::VirtualSite;
use crate::node::BringUpError;
use crate::node::Node;
use crate::remote::Remote;

/// Requests that may wait for the next cycle.
const REQUESTS: usize = 8;

/// Runs the node until a signal ends it.
pub(super) fn run(args: &Run) -> Result<(), Failure> {
    let config = args.config.load()?;
    gains::warn(&config);
    commission::warn(&config);
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("no runtime").or_fail(Kind::Bus)?;
    // From here on a signal ends it in order; before, there was nothing to end.
    let orders = runtime.block_on(async { Orders::heard() });
    let orders = orders.context("no signals").or_fail(Kind::Bus)?;
    let path = config.socket.clone().unwrap_or_else(default_socket);
    let socket = runtime.block_on(Socket::bind(path.clone()));
    let socket = socket.with_context(|| format!("control socket {}", path.display()));
    let socket = socket.or_fail(Kind::Bus)?;

    let bus = open(&config, &names)?;
    let epoch = bus.epoch_micros();
    let mut keeper = match &args.record {
        Some(folder) => Keeper::of_session(folder, &names, epoch).or_fail(Kind::Bus)?,
        None => Keeper::of_faults_alone(&names, epoch),
    };

    let (offer, entries, lost) = recorder::queue();
    let node = Node::new(&config, Traced::new(bus, offer.clone()), VirtualSite::new(&config));
    let (requests, asked) = mpsc::channel(REQUESTS);
    let (ended, end) = oneshot::channel();
    let stop = Arc::new(AtomicBool::new(false));
    let latest = Latest::default();

    let (outcome, summary) = thread::scope(|threads| -> Result<_, Failure> {
        let cycle_stop = Arc::clone(&stop);
        let cycle = move || {
            let outcome = attend(node, asked, &offer, &cycle_stop);
            // The main thread may have gone before.
            ended.send(outcome).ok();
        };
        thread::Builder::new()
            .name("frhc-cycle".to_owned())
            .spawn_scoped(threads, cycle)
            .context("no thread for the cycle")
            .or_fail(Kind::Bus)?;
        let (keeper, shown) = (&mut keeper, latest.clone());
        let names: Vec<_> = config.node_plans().into_iter().map(|(_, plan)| plan.name).collect();
        let recording =
            threads.spawn(move || recorder::record(&entries, keeper, &shown, &names, &lost));
        let outcome = runtime.block_on(serve(&socket, requests, &latest, orders, &stop, end));
        let summary = recording.join();
        let summary = summary.map_err(|_| Failure::new(Kind::Bus, "the recorder failed"))?;
        Ok((outcome, summary))
    })?;
    let (left, finished) = keeper.finish(&summary);
    if summary.cycles > 0 {
        print::note(&summary.to_string());
    }
    left.iter().for_each(|line| print::note(line));
    outcome.and(finished.or_fail(Kind::Bus))
}

/// The buses, on interfaces that are fit for torques; what is to be said of them is told.
fn open(config: &Config, names: &[String]) -> Result<SocketCan, Failure> {
    let bus = SocketCan::open(names).or_fail(Kind::Bus)?;
    let bus = bus.hearing_only(&config.patterns()).and_then(SocketCan::with_witness);
    let bus = bus.or_fail(Kind::Bus)?;
    for remark in interface::check(names).or_fail(Kind::Bus)? {
        tracing::warn!("{remark}");
    }
    Ok(bus)
}

/// Serves console and signals until the cycle's thread has ended.
async fn serve(
    socket: &Socket,
    requests: mpsc::Sender<Pending>,
    latest: &Latest,
    mut orders: Orders,
    stop: &AtomicBool,
    mut end: oneshot::Receiver<Result<(), Failure>>,
) -> Result<(), Failure> {
    let console = socket.serve(requests, latest);
    tokio::pin!(console);
    loop {
        tokio::select! {
            outcome = &mut end => {
                return outcome.unwrap_or_else(|_| Err(Failure::new(Kind::Bus, "the cycle failed")));
            }
            order = orders.next() => match order {
                Order::Stop(signal) => {
                    let is_new = !stop.swap(true, Ordering::Relaxed);
                    tracing::info!(signal, "{}", if is_new { "stopping" } else { "already stopping" });
                }
                Order::HangUp => {
                    tracing::info!("SIGHUP: ignored, the configuration is read at the start alone");
                }
            },
            () = &mut console => {}
        }
    }
}

/// The cycle's thread: bring-up, cycles, stop.
fn attend<B: Bus, R: Remote>(
    mut node: Node<B, R>,
    mut asked: mpsc::Receiver<Pending>,
    offer: &Offer,
    stop: &AtomicBool,
) -> Result<(), Failure> {
    let granted = realtime::ask();
    tracing::info!(%granted, "priority");
    let stopping = || stop.load(Ordering::Relaxed);
    let booted = node.bring_up(&mut || stopping());
    pass_on(&mut node, offer);
    match booted {
        Ok(()) => tracing::info!("ready: all drives enabled at zero torque"),
        Err(BringUpError::GivenUp) => return Ok(()),
        Err(error @ BringUpError::Bus(_)) => return Err(error).or_fail(Kind::Bus),
        Err(
            error @ (BringUpError::Boot(_) | BringUpError::LeftOn(_) | BringUpError::NotProven(_)),
        ) => {
            return Err(error).or_fail(Kind::Drive);
        }
        Err(error @ BringUpError::NotEnabled(_)) => {
            // A trip like any other: it is recorded.
            offer.record(node.cycle());
            return Err(error).or_fail(Kind::Drive);
        }
    }
    while !stopping() {
        if let Ok(Pending { request, answer }) = asked.try_recv() {
            // Whoever asked may have hung up.
            answer.send(node.request(request, &mut || stopping())).ok();
        }
        offer.record(node.cycle());
        pass_on(&mut node, offer);
    }
    let stopped_by = node.cause();
    let stop = |reason| Failure::new(Kind::Stopped, reason);
    match (stopped_by, node.stop()) {
        (None, confirmed) => confirmed.or_fail(Kind::Drive),
        (Some(cause), Ok(())) => Err(stop(format!("stopped by {cause}"))),
        (Some(cause), Err(error)) => Err(stop(format!("stopped by {cause}; {error}"))),
    }
}

/// What has happened on the network goes to whoever writes messages.
fn pass_on<B: Bus, R: Remote>(node: &mut Node<B, R>, offer: &Offer) {
    while let Some(event) = node.notice() {
        offer.notice(event);
    }
}
