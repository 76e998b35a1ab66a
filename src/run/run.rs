//! `frhc run`: the node on SocketCAN. The main thread serves the console; separate threads run the cycle, the recorder,
//! stderr and signals.

use std::path::PathBuf;
use std::process;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, Scope, ScopedJoinHandle};
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use tokio::runtime::Runtime;
use tokio::sync::oneshot;

use crate::config_arg::TrustedConfigArg;
use crate::console::{RequestHandler, Socket, default_socket, request_queue};
use crate::disk_writers::DiskWriters;
use crate::exit::{Failure, Kind, OrFail};
use crate::feed_socket::{self, Publisher};
use crate::input_ring::input_ring;
use crate::interfaces::{self, Interfaces};
use crate::latch::LatchFile;
use crate::latest_status::LatestStatus;
use crate::limits::LimitArgs;
use crate::provenance::Provenance;
use crate::realtime_args::RealtimeArgs;
use crate::recorder_thread::{self, Recorder};
use crate::recording_state::RecordingState;
use crate::run_recorder::RunRecorder;
use crate::socket_name::socket_name;
use crate::sources::Sources;
use crate::stop_signals::StopSignals;
use crate::{
    check, commanded_side, commission, cycle_thread, gains, log_time, print, rings, session, state,
    threads,
};
use bus::{TappedBus, interface};
use config::Config;
use config::files::Copies;
use inputs::RecordedNode;
use remote::link::LinkThread;
use telemetry::feed::{Feed, Source};
use telemetry::manifest::SessionKind;
use telemetry::origin::Origin;
use telemetry::summary::Summary;
use units::time::Instant;

/// Maximum time from the stop signal to the end of the recordings, so that the process ends within a second.
const END_LIMIT: Duration = Duration::from_millis(900);

/// Minimum time allowed for the recordings to end, even if the drives stop late.
const MIN_CLOSE_TIME: Duration = Duration::from_millis(100);

/// `frhc run`.
#[derive(Debug, Args)]
pub struct Run {
    #[command(flatten)]
    pub config: TrustedConfigArg,
    #[command(flatten)]
    pub interfaces: Interfaces,
    /// Record the session in a new folder DIR/NNN-UTC: bus.log (candump format), the inputs of the node for frhc replay,
    /// copies of all files, summary.json, timing.json and faults/.
    #[arg(short, short_alias = 'o', long, visible_alias = "out", value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// Leave host name and folders out of the session's description.
    #[arg(long, requires = "record")]
    pub anonymise: bool,
    #[command(flatten)]
    pub limits: LimitArgs,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
}

/// Runs the node until a stop signal.
///
/// # Errors
/// Returns the reason why the node could not start, or was stopped. Its kind gives the exit code.
pub fn run(args: &Run) -> Result<(), Failure> {
    args.realtime.check()?;
    let signals = StopSignals::start().context("cannot receive signals").or_fail(Kind::System)?;
    let (config, copies) = args.config.load()?;
    check::refuse_simulated_link(&config, "run")?;
    warn(&config);
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let runtime = async_runtime()?;
    // Before the control socket, so that a node that answers has its link.
    let (side, link) = commanded_side::open(&config)?;
    let (link, _link_file) = link.unzip();
    let socket = bind_socket(&config, &runtime)?;

    let bus = interfaces::open(&config, &names)?;
    log_time::set_clock(bus.clock());
    let clock = bus.clock();
    let origin = Origin::from_micros(bus.epoch_micros());
    tracing::info!("time counts from {origin}");
    let telemetry = offer_telemetry(&config, origin)?;
    let recorder = open_recorder(args, copies, &Provenance::new(&config, &names, origin))?;

    let recording = recorder.recording();
    let (producer, entries, lost) = rings::rings();
    let (input_producer, input_consumer) = input_ring(recorder.has_session(), lost.clone());
    let mut writers = DiskWriters::start(recorder, lost.clone()).or_fail(Kind::System)?;
    let (sender, requests) = request_queue::channel();
    let (ended, end) = oneshot::channel();
    let link_status = link.as_ref().map(LinkThread::latest);
    let latest = LatestStatus::from_config(&config, recording.clone()).with_link(link_status);
    let latch = LatchFile::set(&names, &described(&config, origin));
    let remark = latch.remark().map(|remark| with_advice(remark, &names));
    remark.iter().for_each(|remark| tracing::warn!("{remark}"));
    let limit = config.disarm_timeout();
    let handler = Arc::new(RequestHandler::new(sender, latest.clone(), clock, remark, limit));
    signals.enable_orderly_stop();

    let has_ended = &AtomicBool::new(false);
    let (outcome, mut summary) = thread::scope(|threads| -> Result<_, Failure> {
        let recorder = Recorder::new(&config, &mut writers, latest).with_telemetry(telemetry);
        let recorded = spawn(threads, "recorder", move || {
            recorder_thread::run(entries, input_consumer, recorder, &lost)
        })?;
        let signals = &signals;
        link.map(|link| spawn_link(threads, link, clock, has_ended)).transpose()?;
        let config = &config;
        spawn(threads, "cycle", move || {
            let bus = TappedBus::new(bus, producer);
            let node = RecordedNode::new(config, bus, side, Rc::new(input_producer));
            let outcome = cycle_thread::run(node, requests, signals, latch, &args.realtime);
            has_ended.store(true, Ordering::Relaxed);
            // The main thread may have ended first.
            ended.send(outcome).ok();
        })?;
        let outcome = runtime.block_on(serve(&socket, &handler, end));
        let panicked = |_| Failure::new(Kind::Bus, "the recorder thread panicked");
        Ok((outcome, recorded.join().map_err(panicked)?))
    })?;
    summary.origin = origin;
    let stopped = signals.stop_requested_at().unwrap_or_else(clock);
    let finished = close(writers, summary, recording.as_ref(), stopped, clock);
    if let (Err(_), Err(incomplete)) = (&outcome, &finished) {
        // The exit code is that of the stop.
        print::error(&incomplete.to_string());
    }
    outcome.and(finished)
}

/// Describes this run for the next one.
fn described(config: &Config, origin: Origin) -> String {
    format!(
        "the run of {} begun {} (process {})",
        config.file.display(),
        origin.utc(),
        process::id()
    )
}

/// Adds to the remark of a latch what spares simulated drives the latch of real ones.
fn with_advice(remark: &str, interfaces: &[String]) -> String {
    let is_simulated = interfaces.iter().all(|name| interface::is_virtual(name));
    if state::is_named() || !is_simulated {
        return remark.to_owned();
    }
    format!("{remark}. With STATE_DIRECTORY=DIR simulated drives have a latch of their own")
}

/// Logs warnings about settings with which the node starts, but an operator may not get the expected behaviour.
fn warn(config: &Config) {
    gains::log(config);
    commission::warn(config);
    check::warn_no_switch_box(config);
}

/// Returns the runtime of the control socket.
fn async_runtime() -> Result<Runtime, Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.context("cannot start the async runtime").or_fail(Kind::System)
}

/// Binds the control socket of the configuration, or the default one.
fn bind_socket(config: &Config, runtime: &Runtime) -> Result<Socket, Failure> {
    let path = config.socket.clone().unwrap_or_else(default_socket);
    let _entered = runtime.enter();
    let socket = Socket::bind(path.clone());
    let named = || socket_name("control", &path, "node.socket", config.socket.as_deref(), config);
    socket.with_context(named).or_fail(Kind::Bus)
}

/// Starts telemetry at the configured path, or at the default one. A failure at the default path is only a warning.
fn offer_telemetry(config: &Config, origin: Origin) -> Result<Option<Publisher>, Failure> {
    let path = feed_socket::of_config(config);
    let feed = Feed::new(config, Source::Run, Some(origin));
    let started = Publisher::start(&path, feed);
    let configured = config.telemetry_socket.as_deref();
    let named = || socket_name("telemetry", &path, "node.telemetry_socket", configured, config);
    match started.with_context(named) {
        Ok(publisher) => Ok(Some(publisher)),
        Err(error) if config.telemetry_socket.is_some() => Err(error).or_fail(Kind::Bus),
        Err(error) => {
            tracing::warn!("no telemetry: {error:#}");
            Ok(None)
        }
    }
}

/// Starts the thread `frhc-NAME`.
fn spawn<'scope, T: Send + 'scope>(
    threads: &'scope Scope<'scope, '_>,
    name: &str,
    task: impl FnOnce() -> T + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, T>, Failure> {
    let thread = threads::builder(name).spawn_scoped(threads, task);
    thread.with_context(|| format!("cannot start the {name} thread")).or_fail(Kind::System)
}

/// Starts the link's thread, which ends with the cycle.
fn spawn_link<'scope>(
    threads: &'scope Scope<'scope, '_>,
    link: LinkThread,
    clock: impl Fn() -> Instant + Send + 'scope,
    has_ended: &'scope AtomicBool,
) -> Result<ScopedJoinHandle<'scope, ()>, Failure> {
    spawn(threads, "link", move || link.run(clock, || has_ended.load(Ordering::Relaxed)))
}

/// Ends the recordings of a stopped run, and prints its summary and the folder of fault records.
fn close(
    writers: DiskWriters,
    mut summary: Summary,
    recording: Option<&RecordingState>,
    stopped: Instant,
    clock: impl Fn() -> Instant,
) -> Result<(), Failure> {
    let deadline = (stopped + END_LIMIT).max(clock() + MIN_CLOSE_TIME);
    let (records, finished) = writers.finish(&summary, deadline, clock);
    summary.recording = recording.map(RecordingState::get);
    if summary.cycles > 0 {
        print::note(&summary.to_string());
    }
    records.iter().for_each(|line| print::note(line));
    finished.or_fail(Kind::File)
}

/// Opens the recordings: fault records and, with `--record`, a session in a numbered folder with copies of all files.
fn open_recorder(
    args: &Run,
    copies: Copies,
    provenance: &Provenance,
) -> Result<RunRecorder, Failure> {
    let Some(parent) = &args.record else {
        return Ok(RunRecorder::fault_records_only(provenance));
    };
    let folder = session::create_numbered(parent, provenance.origin).or_fail(Kind::File)?;
    tracing::info!("recording in {}", folder.display());
    let sources = Sources {
        kind: SessionKind::Run,
        configuration: args.config.path().to_path_buf(),
        robot: None,
        scenario: None,
        case: None,
        without_passivity: false,
        copies,
        is_anonymous: args.anonymise,
    };
    RunRecorder::with_session(&folder, provenance, &sources, args.limits.limits())
        .or_fail(Kind::File)
}

/// Serves the console until the cycle thread ends.
async fn serve(
    socket: &Socket,
    handler: &Arc<RequestHandler>,
    end: oneshot::Receiver<Result<(), Failure>>,
) -> Result<(), Failure> {
    let failed = || Err(Failure::new(Kind::Bus, "the cycle thread failed"));
    tokio::select! {
        outcome = end => outcome.unwrap_or_else(|_| failed()),
        () = socket.serve(handler) => failed(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch;

    #[test]
    fn taken_socket_is_named_by_its_key() {
        let folder = scratch::path("taken-key");
        let socket = folder.join("node.sock");
        let keys = format!("socket = \"{}\"", socket.display());
        let config = Config::load(&scratch::configuration(&folder, &keys)).unwrap();
        let runtime = async_runtime().unwrap();
        let first = bind_socket(&config, &runtime).unwrap();
        let refused = bind_socket(&config, &runtime).unwrap_err().to_string();
        let (socket, file) = (socket.display(), config.file.display());
        let expected = format!(
            "control socket {socket} (node.socket of {file}): another process listens on this socket"
        );
        assert_eq!(refused, expected);
        drop(first);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
