//! The cycle thread of `frhc run` without its thread: boots, requests, latch and stop, on the in-memory bus.

use std::cell::Cell;
use std::sync::Arc;

use crate::common::prelude::*;
use bus::TappedBus;
use canopen_device::station::Station;
use controller::switches::CommandMode;
use inputs::RecordedNode;
use remote::site::VirtualSite;
use run::console::request_queue::{self, Phase, RequestReceiver, RequestSender};
use run::cycle_thread::{self, RunEnd};
use run::exit::{Failure, Kind};
use run::latch::LatchFile;
use run::rings::{self, EntryConsumer, EntryProducer};

/// A node without threads, on an in-memory bus.
struct Bench<S> {
    node: RecordedNode<TappedBus<Memory<S, ()>, EntryProducer>, VirtualSite>,
    sender: RequestSender,
    requests: RequestReceiver,
    latch: LatchFile,
    folder: PathBuf,
    /// A ring without its other end loses all.
    _consumer: EntryConsumer,
}

impl<S: Station> Bench<S> {
    /// Uses a separate state folder; `crashed` leaves the latch of a crashed run in it.
    fn new(name: &str, crashed: bool, stations: S) -> Self {
        let folder = std::env::temp_dir().join(format!("frhc-{}-{name}", std::process::id()));
        fs::remove_dir_all(&folder).ok(); // left by an earlier process with this id
        let set =
            || LatchFile::set_in(folder.clone(), None, &["can0".to_owned()], "the run of a test");
        if crashed {
            drop(set());
        }
        let latch = set();
        let config = config(KRAFT);
        let (producer, consumer, _) = rings::rings();
        let bus = TappedBus::new(Memory::new(&[1_000_000], stations, ()), producer);
        let side = VirtualSite::new(&config.remote, config.period);
        let node = RecordedNode::new(&config, bus, side, ());
        let (sender, requests) = request_queue::channel();
        Self { node, sender, requests, latch, folder, _consumer: consumer }
    }

    /// Runs until `stopping` returns true; it is called at least once a cycle and during boots.
    fn run(&mut self, stopping: &impl Fn() -> bool) -> RunEnd {
        cycle_thread::run_node(
            &mut self.node,
            &mut self.requests,
            &mut self.latch,
            stopping,
            &|| false,
        )
    }

    fn execute_requests(&mut self) {
        cycle_thread::execute_requests(
            &mut self.node,
            &mut self.requests,
            &mut self.latch,
            &|| false,
        );
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

fn bench(name: &str, crashed: bool) -> Bench<World> {
    let world = world::build(&config(KRAFT), script("seconds = 60"), 1);
    Bench::new(name, crashed, world)
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
    let mut bench = Bench::new("run-no-devices", false, NoDevices);
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
    let reason = bench.latch.awaits().unwrap();
    bench.node.bring_up_unpowered(reason, &mut || false).unwrap();
    let begun = bench.node.bus().now();
    bench.requests.end_boot(begun);
    let reset = bench.sender.send(Request::Reset, begun, &Arc::default()).unwrap();
    let arm = bench.sender.send(Request::Arm, begun, &Arc::default()).unwrap();
    bench.execute_requests();
    assert_eq!(reset.blocking_recv().unwrap().unwrap(), Mode::Ready);
    assert_eq!(bench.latch.awaits(), None);
    assert!(arm.blocking_recv().unwrap().unwrap_err().to_string().contains("booting"));
    bench.execute_requests();
    assert_eq!(bench.node.mode(), Mode::Ready);
}

#[test]
fn failed_reset_leaves_the_latch() {
    let mut bench = bench("run-reset-fails", true);
    let reason = bench.latch.awaits().unwrap();
    bench.node.bring_up_unpowered(reason, &mut || false).unwrap();
    bench.requests.end_boot(bench.node.bus().now());
    let now = bench.node.bus().now();
    let reset = bench.sender.send(Request::Reset, now, &Arc::default()).unwrap();
    // A signal ends the boot.
    cycle_thread::execute_requests(&mut bench.node, &mut bench.requests, &mut bench.latch, &|| {
        true
    });
    assert!(reset.blocking_recv().unwrap().is_err());
    assert_eq!(bench.latch.awaits(), Some(reason));
    assert!(bench.node.mode().is_stopped() && bench.node.is_off());
}

#[test]
fn hazard_27_reset_without_a_writable_latch_enables_no_drive() {
    let mut bench = bench("run-no-latch", true);
    fs::remove_dir_all(&bench.folder).unwrap();
    // Not a folder.
    fs::write(&bench.folder, "").unwrap();
    let reason = bench.latch.awaits().unwrap();
    bench.node.bring_up_unpowered(reason, &mut || false).unwrap();
    let now = bench.node.bus().now();
    bench.requests.end_boot(now);
    let reset = bench.sender.send(Request::Reset, now, &Arc::default()).unwrap();
    bench.execute_requests();
    let refused = reset.blocking_recv().unwrap().unwrap_err().to_string();
    assert!(refused.contains("cannot be written"), "{refused}");
    assert_eq!(bench.latch.awaits(), Some(reason));
    assert!(bench.node.mode().is_stopped() && bench.node.is_off());
    fs::remove_file(&bench.folder).unwrap();
}
