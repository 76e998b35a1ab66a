//! The thread of the cycle: priority, bring-up, cycles, stop.

use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use crate::console::{AcceptedRequest, RequestReceiver};
use crate::disk_writers::STACK;
use crate::exit::{Failure, Kind, OrFail};
use crate::latch::Latch;
use crate::print;
use crate::rings::EntryProducer;
use crate::stop_signals::StopSignals;
use crate::stopping;
use bus::realtime::{self, Granted};
use bus::{Bus, Traced};
use node::{BringUpError, Node, Request};
use remote::Remote;

/// Time allowed for the end of the latch, so that a disk that hangs does not keep the process.
const LATCH_TIMEOUT: Duration = Duration::from_millis(300);

/// Result of the cycle thread.
struct Ended {
    /// Every drive is confirmed disabled, and no stop is latched.
    is_orderly: bool,
    outcome: Result<(), Failure>,
}

impl Ended {
    fn of(is_orderly: bool, outcome: Result<(), Failure>) -> Self {
        Self { is_orderly, outcome }
    }
}

/// Runs the cycle thread: priority, bring-up, cycles, stop. Removes the latch after an orderly end.
pub(super) fn run<B: Bus, R: Remote>(
    mut node: Node<Traced<B, EntryProducer>, R>,
    mut requests: RequestReceiver,
    signals: &StopSignals,
    mut latch: Latch,
) -> Result<(), Failure> {
    let granted = realtime::ask();
    match warning(granted) {
        None => tracing::info!(%granted, "priority"),
        // Also with `-q`, which leaves errors only in the log.
        Some(warning) => print::error(&warning),
    }
    let stopping = || signals.is_stop_requested();
    let is_urgent = || signals.is_urgent();
    let Ended { is_orderly, outcome } =
        run_node(&mut node, &mut requests, &mut latch, &stopping, &is_urgent);
    let reason = || outcome.as_ref().err().map_or_else(String::new, ToString::to_string);
    let end = if is_orderly { Ok(()) } else { Err(reason()) };
    match within(LATCH_TIMEOUT, move || latch.end(end)) {
        Some(message) => message.iter().for_each(|line| tracing::warn!("{line}")),
        None => tracing::warn!(
            "the disk of the latch does not respond: the next run may wait for a reset"
        ),
    }
    outcome
}

/// Returns the warning of real-time settings that the kernel refused.
fn warning(granted: Granted) -> Option<String> {
    let warning = || {
        format!(
            "warning: real-time settings refused, so cycles may be late: {granted}; LimitRTPRIO=80 and \
             LimitMEMLOCK=512M of systemd/frhc.service allow them"
        )
    };
    (!granted.is_all()).then(warning)
}

/// Runs `task` on a thread of its own; returns `None` if it takes longer than `limit`.
fn within<T: Send + 'static>(
    limit: Duration,
    task: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, result) = channel();
    let thread = thread::Builder::new().name("frhc-latch".to_owned()).stack_size(STACK);
    // Without a thread the sender is dropped: nothing is received.
    thread.spawn(move || sender.send(task()).ok()).ok();
    result.recv_timeout(limit).ok()
}

/// Boots the node and runs cycles until `stopping` returns true, then stops the drives in order unless it `is_urgent`.
fn run_node<B: Bus, R: Remote>(
    node: &mut Node<Traced<B, EntryProducer>, R>,
    requests: &mut RequestReceiver,
    latch: &mut Latch,
    stopping: &impl Fn() -> bool,
    is_urgent: &impl Fn() -> bool,
) -> Ended {
    let mut give_up = || {
        requests.answer_during_boot();
        stopping()
    };
    let booted = match latch.cause() {
        None => node.bring_up(&mut give_up),
        Some(cause) => node.bring_up_unpowered(cause, &mut give_up),
    };
    match booted {
        Ok(()) if latch.cause().is_some() => {
            tracing::warn!("waiting for `frhc ctl reset`: no drive is enabled");
        }
        // The recorder thread logs that the drives are enabled, behind the events of the boot.
        Ok(()) => {}
        Err(error) => return boot_failure(node, error),
    }
    requests.end_boot(node.bus().now());
    while !stopping() {
        execute_requests(node, requests, latch, stopping);
        // Events of a cycle are behind its record, which is pushed at its end; those of a boot are pushed at once.
        node.bus_mut().tap_mut().takes_events(false);
        run_cycle(node);
        forward_events(node);
        node.bus_mut().tap_mut().takes_events(true);
    }
    requests.close();
    let stopped_by = node.cause().map(|cause| node.in_words(cause));
    let stop = |reason| Failure::new(Kind::Stopped, reason);
    let off = node.stop(&mut || is_urgent());
    match (stopped_by, off) {
        (None, confirmed) => Ended::of(confirmed.is_ok(), confirmed.or_fail(Kind::Drive)),
        (Some(cause), Ok(())) => Ended::of(false, Err(stop(format!("stopped by {cause}")))),
        (Some(cause), Err(error)) => {
            Ended::of(false, Err(stop(format!("stopped by {cause}; {error}"))))
        }
    }
}

/// Returns the result of a failed boot. If no drive was enabled, the end is orderly and latches nothing.
fn boot_failure<B: Bus, R: Remote>(
    node: &mut Node<Traced<B, EntryProducer>, R>,
    error: BringUpError,
) -> Ended {
    match error {
        BringUpError::GivenUp => Ended::of(true, Ok(())),
        BringUpError::Bus(_) | BringUpError::Unfit(_) => {
            Ended::of(true, Err(error).or_fail(Kind::Bus))
        }
        BringUpError::Boot(_) => Ended::of(true, Err(error).or_fail(Kind::Drive)),
        BringUpError::Mode(_) | BringUpError::ProofTest(_) => {
            Ended::of(node.is_off(), Err(error).or_fail(Kind::Drive))
        }
        BringUpError::LeftOn(_) => Ended::of(false, Err(error).or_fail(Kind::Drive)),
        BringUpError::NotEnabled(_) => {
            // Records the trip.
            run_cycle(node);
            Ended::of(false, Err(error).or_fail(Kind::Drive))
        }
    }
}

/// Runs one cycle and queues its record.
fn run_cycle<B: Bus, R: Remote>(node: &mut Node<Traced<B, EntryProducer>, R>) {
    let record = node.cycle();
    node.bus_mut().tap_mut().push_record(&record);
}

/// Executes a pending disarm, and then at most one other request.
fn execute_requests<B: Bus, R: Remote>(
    node: &mut Node<B, R>,
    requests: &mut RequestReceiver,
    latch: &mut Latch,
    stopping: &impl Fn() -> bool,
) {
    if let Some(disarm) = requests.pending_disarm() {
        // A disarm is never refused.
        let mode = node.request(Request::Disarm, &mut || false).unwrap_or(node.mode());
        requests.complete_disarm(disarm, mode);
    }
    let Some(accepted) = requests.next(node.bus().now()) else { return };
    let AcceptedRequest { request, .. } = accepted;
    let mut has_booted = false;
    if request == Request::Reset
        && let Err(reason) = latch.before_reset()
    {
        return accepted.refuse_without_latch(reason);
    }
    let outcome = node.request(request, &mut || {
        has_booted = true;
        requests.begin_boot();
        requests.answer_during_boot();
        stopping()
    });
    if has_booted {
        requests.end_boot(node.bus().now());
    }
    if request == Request::Reset {
        match &outcome {
            Ok(_) => latch.release(),
            Err(_) if node.is_off() => latch.restore(),
            // A drive may be enabled: the latch says that this run has not ended in order.
            Err(_) => {}
        }
    }
    if request == Request::Arm && outcome.is_ok() {
        stopping::facts(node.facts()).iter().for_each(|line| tracing::info!("{line}"));
    }
    accepted.answer(outcome);
}

/// Queues events on the network for the recorder thread.
fn forward_events<B: Bus, R: Remote>(node: &mut Node<Traced<B, EntryProducer>, R>) {
    while let Some(event) = node.notice() {
        node.bus_mut().tap_mut().push_event(event);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::fs;
    use std::path::{Path, PathBuf};
    use std::sync::Arc;

    use super::*;
    use crate::console::{self, Phase, RequestSender};
    use crate::rings::{self, EntryConsumer};
    use canopen::frame::{Channel, Frame, Telegram};
    use canopen::station::Station;
    use config::Config;
    use controller::switches::Mode as CommandMode;
    use memory_bus::Memory;
    use node::record::Mode;
    use remote::site::VirtualSite;
    use sim::scenario::Scenario;
    use sim::world::World;
    use testbench::world;
    use units::time::Instant;

    /// A node without threads, on an in-memory bus.
    struct Bench<S> {
        node: Node<Traced<Memory<S, ()>, EntryProducer>, VirtualSite>,
        sender: RequestSender,
        requests: RequestReceiver,
        latch: Latch,
        folder: PathBuf,
        /// RecordSink: a ring without its other end loses all.
        _consumer: EntryConsumer,
    }

    impl<S: Station> Bench<S> {
        /// Uses a state folder of its own; `crashed` leaves the latch of a crashed run in it.
        fn of(name: &str, crashed: bool, stations: S) -> Self {
            let folder = crate::scratch::path(name);
            let set = || Latch::set_in(folder.clone(), None, &["can0".to_owned()]);
            if crashed {
                drop(set());
            }
            let latch = set();
            let config = config();
            let (producer, consumer, _) = rings::rings();
            let bus = Traced::new(Memory::new(&[1_000_000], stations, ()), producer);
            let node = Node::new(&config, bus, VirtualSite::new(&config.remote, config.period));
            let (sender, requests) = console::channel();
            Self { node, sender, requests, latch, folder, _consumer: consumer }
        }

        /// Runs until `stopping` returns true; it is called at least once a cycle and during boots.
        fn run(&mut self, stopping: &impl Fn() -> bool) -> Ended {
            run_node(&mut self.node, &mut self.requests, &mut self.latch, stopping, &|| false)
        }

        fn execute_requests(&mut self) {
            execute_requests(&mut self.node, &mut self.requests, &mut self.latch, &|| false);
        }
    }

    impl<S> Drop for Bench<S> {
        fn drop(&mut self) {
            fs::remove_dir_all(&self.folder).ok();
        }
    }

    /// Returns a predicate that becomes true after this many cycles.
    fn after_cycles(cycles: u32, sender: &RequestSender) -> impl Fn() -> bool + use<> {
        let sender = sender.clone();
        let asked = Cell::new(0);
        move || {
            asked.set(asked.get() + u32::from(sender.phase() == Phase::Running));
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

    /// A bus without devices.
    struct NoDevices;

    impl Station for NoDevices {
        fn on_frame(&mut self, _: Instant, _: Channel, _: &Frame, _: &mut Vec<Telegram>) {}

        fn on_time(&mut self, _: Instant, _: &mut Vec<Telegram>) {}

        fn deadline(&self) -> Option<Instant> {
            None
        }
    }

    #[test]
    fn refused_real_time_setting_is_a_warning() {
        let all = Granted { is_fifo: true, is_locked: true, is_exact: true };
        assert_eq!(warning(all), None);
        let warned = warning(Granted { is_locked: false, ..all }).unwrap();
        assert!(warned.starts_with("warning: ") && warned.contains("memory locked refused"));
    }

    #[test]
    fn hazard_32_hung_disk_of_the_latch_keeps_no_thread() {
        assert_eq!(within(Duration::from_secs(60), || 7), Some(7));
        let (release, hangs) = channel::<()>();
        assert_eq!(within(Duration::ZERO, move || hangs.recv().is_ok()), None);
        drop(release);
    }

    #[test]
    fn stopped_run_ends_in_order_with_all_drives_off() {
        let mut bench = bench("run-orderly", false);
        let ended = bench.run(&after_cycles(20, &bench.sender.clone()));
        ended.outcome.unwrap();
        assert!(ended.is_orderly && bench.node.is_off());
        let denied = bench.sender.send(Request::Arm, bench.node.bus().now(), &Arc::default());
        assert_eq!(denied.unwrap_err().to_string(), "the node is stopping");
    }

    #[test]
    fn cancelled_boot_is_an_orderly_end() {
        let mut bench = bench("run-given-up", false);
        let ended = bench.run(&|| true);
        ended.outcome.unwrap();
        assert!(ended.is_orderly);
    }

    #[test]
    fn boot_without_drives_fails_and_latches_nothing() {
        let mut bench = Bench::of("run-no-devices", false, NoDevices);
        let ended = bench.run(&|| false);
        let [code, of_drives] =
            [ended.outcome.unwrap_err(), Failure::new(Kind::Drive, "")].map(|it| it.code());
        assert_eq!(format!("{code:?}"), format!("{of_drives:?}"));
        assert!(ended.is_orderly, "no drive was enabled");
    }

    #[test]
    fn run_after_a_crash_enables_nothing_and_ends_stopped() {
        let mut bench = bench("run-crashed", true);
        let ended = bench.run(&after_cycles(20, &bench.sender.clone()));
        let failure = ended.outcome.unwrap_err();
        assert!(failure.to_string().starts_with("stopped by "), "{failure}");
        assert!(!ended.is_orderly && bench.node.is_off());
    }

    #[test]
    fn disarm_precedes_queued_requests() {
        let mut bench = bench("run-disarm", false);
        bench.node.bring_up(&mut || false).unwrap();
        bench.requests.end_boot(bench.node.bus().now());
        let now = bench.node.bus().now();
        let arm = bench.sender.send(Request::Arm, now, &Arc::default()).unwrap();
        bench.execute_requests();
        assert_eq!(arm.blocking_recv().unwrap().unwrap(), Mode::Armed);
        let rate = Request::Command(CommandMode::Rate);
        let queued = bench.sender.send(rate, now, &Arc::default()).unwrap();
        let disarm = bench.sender.request_disarm();
        bench.execute_requests();
        assert!(bench.sender.disarm_result(disarm).is_some());
        assert!(queued.blocking_recv().unwrap().is_err(), "void since the disarm");
    }

    #[test]
    fn reset_boots_releases_the_latch_and_voids_queued_requests() {
        let mut bench = bench("run-reset", true);
        let cause = bench.latch.cause().unwrap();
        bench.node.bring_up_unpowered(cause, &mut || false).unwrap();
        let begun = bench.node.bus().now();
        bench.requests.end_boot(begun);
        let reset = bench.sender.send(Request::Reset, begun, &Arc::default()).unwrap();
        let arm = bench.sender.send(Request::Arm, begun, &Arc::default()).unwrap();
        bench.execute_requests();
        assert_eq!(reset.blocking_recv().unwrap().unwrap(), Mode::Ready);
        assert_eq!(bench.latch.cause(), None);
        assert!(arm.blocking_recv().unwrap().unwrap_err().to_string().contains("booting"));
        bench.execute_requests();
        assert_eq!(bench.node.mode(), Mode::Ready);
    }

    #[test]
    fn failed_reset_leaves_the_latch() {
        let mut bench = bench("run-reset-fails", true);
        let cause = bench.latch.cause().unwrap();
        bench.node.bring_up_unpowered(cause, &mut || false).unwrap();
        bench.requests.end_boot(bench.node.bus().now());
        let now = bench.node.bus().now();
        let reset = bench.sender.send(Request::Reset, now, &Arc::default()).unwrap();
        // A signal ends the boot.
        execute_requests(&mut bench.node, &mut bench.requests, &mut bench.latch, &|| true);
        assert!(reset.blocking_recv().unwrap().is_err());
        assert_eq!(bench.latch.cause(), Some(cause));
        assert!(bench.node.mode().is_stopped() && bench.node.is_off());
    }

    #[test]
    fn hazard_27_reset_without_a_writable_latch_enables_no_drive() {
        let mut bench = bench("run-no-latch", true);
        fs::remove_dir_all(&bench.folder).unwrap();
        // Not a folder.
        fs::write(&bench.folder, "").unwrap();
        let cause = bench.latch.cause().unwrap();
        bench.node.bring_up_unpowered(cause, &mut || false).unwrap();
        let now = bench.node.bus().now();
        bench.requests.end_boot(now);
        let reset = bench.sender.send(Request::Reset, now, &Arc::default()).unwrap();
        bench.execute_requests();
        let refused = reset.blocking_recv().unwrap().unwrap_err().to_string();
        assert!(refused.contains("cannot be written"), "{refused}");
        assert_eq!(bench.latch.cause(), Some(cause));
        assert!(bench.node.mode().is_stopped() && bench.node.is_off());
        fs::remove_file(&bench.folder).unwrap();
    }
}
