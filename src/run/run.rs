//! `frhc run`: the node on SocketCAN. One thread runs the cycle and nothing else, one writes its
//! records, one its messages, one reads signals, and this one serves the console.

use std::path::Path;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use anyhow::Context;
use clap::Args;
use tokio::sync::oneshot;

use crate::archive;
use crate::archive::Archive;
use crate::commission;
use crate::configured::Guarded;
use crate::console;
use crate::console::Desk;
use crate::console::Due;
use crate::console::Inbox;
use crate::console::Socket;
use crate::console::default_socket;
use crate::exit::Failure;
use crate::exit::Kind;
use crate::exit::OrFail;
use crate::gains;
use crate::interfaces;
use crate::interfaces::Interfaces;
use crate::keeper::Keeper;
use crate::latch::Latch;
use crate::orders::Orders;
use crate::print;
use crate::provenance::Provenance;
use crate::recorder;
use crate::recorder::Latest;
use crate::rings;
use crate::rings::Offer;
use crate::session;
use crate::time_line;
use bus::Bus;
use bus::Traced;
use bus::realtime;
use node::BringUpError;
use node::Node;
use node::Request;
use remote::Remote;
use remote::site::VirtualSite;
use telemetry::origin::Origin;

/// `frhc run`.
#[derive(Debug, Args)]
pub struct Run {
    #[command(flatten)]
    pub config: Guarded,
    #[command(flatten)]
    pub interfaces: Interfaces,
    /// Leave bus.log (candump), summary.json and faults/ in a new folder of this one, NNN-UTC.
    #[arg(short, long, value_name = "DIR")]
    pub record: Option<PathBuf>,
}

/// Runs the node until a signal ends it.
///
/// # Errors
/// What kept the node from running, or stopped it; the exit code is that of its kind.
pub fn run(args: &Run) -> Result<(), Failure> {
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
    let node = Node::new(
        &config,
        Traced::new(bus, offer),
        VirtualSite::new(&config.remote, config.period),
    );
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
    let stopping = || orders.stopping();
    let Ended { is_orderly, outcome } = live(&mut node, &mut inbox, &mut latch, &stopping);
    let reason = || outcome.as_ref().err().map_or_else(String::new, ToString::to_string);
    let left = latch.end(if is_orderly { Ok(()) } else { Err(reason()) });
    left.iter().for_each(|line| tracing::warn!("{line}"));
    outcome
}

/// The same without priority and latch's end, until `stopping` says so.
fn live<B: Bus, R: Remote>(
    node: &mut Node<Traced<B, Offer>, R>,
    inbox: &mut Inbox,
    latch: &mut Latch,
    stopping: &impl Fn() -> bool,
) -> Ended {
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
        grant(node, inbox, latch, stopping);
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

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::fs;
    use std::path::PathBuf;

    use super::*;
    use crate::console::Phase;
    use crate::console::Requests;
    use crate::rings::Taker;
    use bus::Memory;
    use canopen::frame::Channel;
    use canopen::frame::Frame;
    use canopen::frame::Telegram;
    use canopen::station::Station;
    use config::Config;
    use controller::switches::Mode as CommandMode;
    use lab::world;
    use node::record::Mode;
    use sim::scenario::Scenario;
    use sim::world::World;
    use units::time::Instant;

    /// A run without its threads, in memory.
    struct Bench<S> {
        node: Node<Traced<Memory<S, ()>, Offer>, VirtualSite>,
        requests: Requests,
        inbox: Inbox,
        latch: Latch,
        folder: PathBuf,
        /// Kept: a ring without its other end loses all.
        _taker: Taker,
    }

    impl<S: Station> Bench<S> {
        /// With a state folder of this test alone. `crashed` leaves it as a run does that crashed.
        fn of(name: &str, crashed: bool, stations: S) -> Self {
            let folder = crate::scratch::path(name);
            let set = || Latch::set_in(Some(folder.clone()), &["can0".to_owned()]);
            if crashed {
                drop(set());
            }
            let latch = set();
            let config = config();
            let (offer, taker, _) = rings::rings();
            let bus = Traced::new(Memory::new(&[1_000_000], stations, ()), offer);
            let node = Node::new(&config, bus, VirtualSite::new(&config.remote, config.period));
            let (requests, inbox) = console::channel();
            Self { node, requests, inbox, latch, folder, _taker: taker }
        }

        /// Lives until `stopping`, which is asked at least once a cycle and during boots.
        fn live(&mut self, stopping: &impl Fn() -> bool) -> Ended {
            live(&mut self.node, &mut self.inbox, &mut self.latch, stopping)
        }

        fn grant(&mut self) {
            grant(&mut self.node, &mut self.inbox, &mut self.latch, &|| false);
        }
    }

    impl<S> Drop for Bench<S> {
        fn drop(&mut self) {
            fs::remove_dir_all(&self.folder).ok();
        }
    }

    /// Says so after so many cycles, of which it is asked once in each.
    fn after_cycles(cycles: u32, requests: &Requests) -> impl Fn() -> bool + use<> {
        let requests = requests.clone();
        let asked = Cell::new(0);
        move || {
            asked.set(asked.get() + u32::from(requests.phase() == Phase::Running));
            asked.get() > cycles
        }
    }

    fn config() -> Config {
        Config::load(Path::new("config/kraft_like.toml")).unwrap()
    }

    fn bench(name: &str, crashed: bool) -> Bench<World> {
        let world = world::build(&config(), Scenario::parse("seconds = 60").unwrap(), 1);
        Bench::of(name, crashed, world)
    }

    /// Cables without devices.
    struct Nobody;

    impl Station for Nobody {
        fn on_frame(&mut self, _: Instant, _: Channel, _: &Frame, _: &mut Vec<Telegram>) {}

        fn on_time(&mut self, _: Instant, _: &mut Vec<Telegram>) {}

        fn deadline(&self) -> Option<Instant> {
            None
        }
    }

    #[test]
    fn run_that_is_stopped_ends_in_order_with_all_drives_off() {
        let mut bench = bench("run-orderly", false);
        let ended = bench.live(&after_cycles(20, &bench.requests.clone()));
        ended.outcome.unwrap();
        assert!(ended.is_orderly && bench.node.is_off());
        let denied = bench.requests.ask(Request::Arm, bench.node.bus().now(), &Arc::default());
        assert_eq!(denied.unwrap_err().to_string(), "the node is stopping");
    }

    #[test]
    fn boot_that_is_given_up_is_an_orderly_end() {
        let mut bench = bench("run-given-up", false);
        let ended = bench.live(&|| true);
        ended.outcome.unwrap();
        assert!(ended.is_orderly);
    }

    #[test]
    fn boot_without_drives_fails_and_latches_nothing() {
        let mut bench = Bench::of("run-nobody", false, Nobody);
        let ended = bench.live(&|| false);
        let [code, of_drives] =
            [ended.outcome.unwrap_err(), Failure::new(Kind::Drive, "")].map(|it| it.code());
        assert_eq!(format!("{code:?}"), format!("{of_drives:?}"));
        assert!(ended.is_orderly, "no drive was enabled");
    }

    #[test]
    fn run_after_a_crash_enables_nothing_and_ends_stopped() {
        let mut bench = bench("run-crashed", true);
        let ended = bench.live(&after_cycles(20, &bench.requests.clone()));
        let failure = ended.outcome.unwrap_err();
        assert!(failure.to_string().starts_with("stopped by "), "{failure}");
        assert!(!ended.is_orderly && bench.node.is_off());
    }

    #[test]
    fn disarm_is_granted_before_what_is_queued() {
        let mut bench = bench("run-disarm", false);
        bench.node.bring_up(&mut || false).unwrap();
        bench.inbox.booted(bench.node.bus().now());
        let now = bench.node.bus().now();
        let arm = bench.requests.ask(Request::Arm, now, &Arc::default()).unwrap();
        bench.grant();
        assert_eq!(arm.blocking_recv().unwrap().unwrap(), Mode::Armed);
        let rate = Request::Command(CommandMode::Rate);
        let queued = bench.requests.ask(rate, now, &Arc::default()).unwrap();
        let disarm = bench.requests.disarm();
        bench.grant();
        assert!(bench.requests.disarmed(disarm).is_some());
        assert!(queued.blocking_recv().unwrap().is_err(), "void since the disarm");
    }

    #[test]
    fn reset_boots_and_releases_the_latch_and_voids_what_was_asked_meanwhile() {
        let mut bench = bench("run-reset", true);
        let cause = bench.latch.cause().unwrap();
        bench.node.bring_up_unpowered(cause, &mut || false).unwrap();
        let begun = bench.node.bus().now();
        bench.inbox.booted(begun);
        let reset = bench.requests.ask(Request::Reset, begun, &Arc::default()).unwrap();
        let arm = bench.requests.ask(Request::Arm, begun, &Arc::default()).unwrap();
        bench.grant();
        assert_eq!(reset.blocking_recv().unwrap().unwrap(), Mode::Ready);
        assert_eq!(bench.latch.cause(), None);
        assert!(arm.blocking_recv().unwrap().unwrap_err().to_string().contains("booting"));
        bench.grant();
        assert_eq!(bench.node.mode(), Mode::Ready);
    }

    #[test]
    fn reset_that_fails_leaves_the_latch() {
        let mut bench = bench("run-reset-fails", true);
        let cause = bench.latch.cause().unwrap();
        bench.node.bring_up_unpowered(cause, &mut || false).unwrap();
        bench.inbox.booted(bench.node.bus().now());
        let now = bench.node.bus().now();
        let reset = bench.requests.ask(Request::Reset, now, &Arc::default()).unwrap();
        // A signal ends the boot.
        grant(&mut bench.node, &mut bench.inbox, &mut bench.latch, &|| true);
        assert!(reset.blocking_recv().unwrap().is_err());
        assert_eq!(bench.latch.cause(), Some(cause));
        assert!(bench.node.mode().is_stopped() && bench.node.is_off());
    }
}
