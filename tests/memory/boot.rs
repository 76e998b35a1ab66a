//! Boot of the complete network (CiA 302-2): frames on the bus and events of the node.
//!
//! `GOLDEN=write cargo test --test memory boot::` rewrites the transcripts; check the difference before you
//! commit it.

use crate::common::golden::compare;
use crate::common::prelude::*;
use canopen::master::steps::Configuration;
use node::BringUpError;
use units::numbering::NodeIndex;

const SWITCHES: usize = 6;

/// Simulated robot of [`KRAFT_500HZ_TEXT`] with replacements, and the frames on its buses.
fn bench(changes: &[(&str, &str)]) -> (Bench<Wire>, Wire) {
    let config = parse(KRAFT_500HZ, &changed(KRAFT_500HZ_TEXT, changes));
    let wire = Wire::default();
    (Bench::new(&config, scenario("free"), 1, wire.clone()), wire)
}

fn events(bench: &mut Bench<Wire>) -> Vec<Event> {
    std::iter::from_fn(|| bench.next_event()).collect()
}

fn configured(events: &[Event], node: usize) -> Configuration {
    let of = |event: &Event| {
        let Event::Configured { node: of, configuration } = event else { return None };
        (of.0 == node).then_some(*configuration)
    };
    events.iter().find_map(of).unwrap()
}

/// Returns whether a frame is NMT, SYNC or of the boot of the switch box.
fn is_of_switches(frame: &Frame) -> bool {
    matches!(frame.cob_id, 0x000 | 0x080 | 0x590 | 0x610 | 0x710)
}

const STORE: (&str, &str) =
    ("heartbeat_ms = 6\n", "heartbeat_ms = 6\nstore_configuration = true\n");
const OPTIONAL: (&str, &str) =
    ("[controller]\n", "[switches.boot]\noptional = true\n\n[controller]\n");

#[test]
fn stored_configuration_is_not_written_again() {
    let (mut bench, wire) = bench(&[STORE]);
    bench.bring_up().unwrap();
    let first = events(&mut bench);
    assert_eq!(configured(&first, 0), Configuration::Stored);
    assert_eq!(configured(&first, SWITCHES), Configuration::Downloaded, "it has no 1020h");
    bench.shut_down().unwrap();
    wire.clear();
    let start = bench.node().bus().now();
    bench.bring_up().unwrap();
    assert_eq!(configured(&events(&mut bench), 0), Configuration::Skipped);
    compare("boot_stored.log", &wire.transcript(12));
    for node in 1..=6 {
        let requests = wire.since(start, 0x600 + node);
        let written: Vec<_> =
            requests.iter().filter(|(_, frame)| frame.data()[0] >> 5 == 1).collect();
        let objects = ["2B40600000000000", "2F6060000A000000"];
        let reports = written.iter().map(|(_, frame)| format!("{frame}"));
        assert!(
            reports.eq(objects.map(|data| format!("{:03X}#{data}", 0x600 + node))),
            "power off, mode"
        );
    }
}

#[test]
fn missing_optional_node_is_reported_and_joins_later() {
    let (mut bench, wire) = bench(&[OPTIONAL]);
    bench.world_mut().switches_mut().unwrap().unplug();
    bench.bring_up().unwrap();
    let booted = events(&mut bench);
    let waited = Duration::from_secs(2);
    assert!(booted.contains(&Event::Absent { node: NodeIndex(SWITCHES), waited }), "{booted:?}");
    compare("boot_absent.log", &wire.transcript_of(12, is_of_switches));
    assert_eq!(bench.node().mode(), Mode::Ready);

    bench.run(100);
    assert_eq!(events(&mut bench), [], "reported once");
    wire.clear();
    let now = bench.node().bus().now();
    bench.world_mut().switches_mut().unwrap().switch_on(now);
    let record = until(&mut bench, |record| record.inputs.is_some());
    assert_eq!(record.mode, Mode::Ready, "otherwise unchanged");
    bench.run(50);
    let joined = events(&mut bench);
    assert_eq!(joined.last(), Some(&Event::Joined { node: NodeIndex(SWITCHES) }), "{joined:?}");
    compare("boot_late.log", &wire.transcript_of(usize::MAX, is_of_switches));
    let syncs = wire.since(now, 0x080);
    let requests = wire.since(now, 0x610);
    for pair in syncs.windows(2) {
        let in_cycle = |at| pair[0].0 <= at && at < pair[1].0;
        let sent = requests.iter().filter(|(at, _)| in_cycle(*at)).count();
        assert!(sent <= 1, "one request a cycle");
    }
}

#[test]
fn all_missing_nodes_are_reported_with_the_boot_timeout() {
    let (mut bench, _) = bench(&[]);
    for joint in [2, 5] {
        bench.world_mut().drive_mut(Joint::new(joint).unwrap()).unwrap().unplug();
    }
    let Err(BringUpError::Boot(failures)) = bench.bring_up() else { panic!("it cannot boot") };
    let reports: Vec<_> = failures.iter().map(ToString::to_string).collect();
    let missing = |joint: &str| format!("{joint}: does not answer, waited 2.0 s");
    let names = ["joint 2 (elevation), node 2", "joint 5 (yaw), node 5"];
    assert_eq!(reports, names.map(missing));
}

#[test]
fn node_guarding_polls_and_a_lost_node_stops_the_robot() {
    let guarding = "[switches.boot]\nguard_time_ms = 20\nlife_time_factor = 3\n\n[controller]\n";
    let drive = "[joint.boot]\nguard_time_ms = 20\nlife_time_factor = 3\n\n[switches]\n";
    let (mut bench, wire) = bench(&[("[controller]\n", guarding), ("[switches]\n", drive)]);
    bench.bring_up().unwrap();
    let start = bench.node().bus().now();
    bench.run(500);
    assert_eq!(bench.node().cause(), None);
    for cob_id in [0x710, 0x706] {
        let guard = wire.since(start, cob_id);
        let requests = guard.iter().filter(|(_, frame)| frame.is_remote()).count();
        assert!((49..=51).contains(&requests), "{requests}");
        assert_eq!(guard.len(), 2 * requests, "one reply each");
    }
    bench.world_mut().switches_mut().unwrap().unplug();
    until(&mut bench, |record| record.mode.is_stopped());
    assert!(events(&mut bench).contains(&Event::HeartbeatLost { node: NodeIndex(SWITCHES) }));
}

#[test]
fn hazard_30_stop_ends_life_guarding_of_drive_and_switch_box() {
    let guarding = "[switches.boot]\nguard_time_ms = 20\nlife_time_factor = 3\n\n[controller]\n";
    let drive = "[joint.boot]\nguard_time_ms = 20\nlife_time_factor = 3\n\n[switches]\n";
    let (mut bench, wire) = bench(&[("[controller]\n", guarding), ("[switches]\n", drive)]);
    bench.bring_up().unwrap();
    bench.run(100);
    bench.shut_down().unwrap();
    let ended = bench.now();
    bench.fall_silent_for(Duration::from_secs(1));
    let drives = bench.node().bus().stations().drives();
    assert!(drives.iter().all(|drive| drive.state() == State::SwitchOnDisabled));
    for emergency in [0x086, 0x090, 0x686, 0x690] {
        assert_eq!(wire.since(ended, emergency), [], "{emergency:03X}h");
    }
    let polls = wire.since(ended, 0x706).into_iter().filter(|(_, frame)| frame.is_remote());
    assert_eq!(polls.count(), 0);
}

#[test]
fn error_history_is_read_at_one_request_per_cycle() {
    let (mut bench, wire) = bench(&[]);
    bench.bring_up().unwrap();
    bench.run(10);
    events(&mut bench);
    let start = bench.node().bus().now();
    bench.world_mut().drive_mut(Joint::of::<3>()).unwrap().fail_with(0x3210);
    until(&mut bench, |record| record.mode.is_stopped());
    bench.run(20);
    let reports: Vec<_> = events(&mut bench).iter().map(ToString::to_string).collect();
    assert!(
        reports[0].starts_with("emergency 3210h DC link over-voltage (generic, voltage)"),
        "{reports:?}"
    );
    // The older entries come from the power-up test.
    let history = "error history (1003h): 3210h DC link over-voltage, 8130h life guard or heartbeat error, \
                   8250h RPDO timeout";
    assert!(reports.iter().any(|report| report == history), "{reports:?}");
    let requests = wire.since(start, 0x603);
    assert_eq!(requests.len(), 4, "number of errors and three entries");
    let is_apart =
        |pair: &[(Instant, Frame)]| pair[1].0.since(pair[0].0) >= Duration::from_millis(1);
    assert!(requests.windows(2).all(is_apart));
}

#[test]
fn error_history_is_read_without_an_emcy() {
    let (mut bench, wire) = bench(&[]);
    bench.bring_up().unwrap();
    let start = bench.node().bus().now();
    bench.world_mut().drive_mut(Joint::of::<4>()).unwrap().fail();
    until(&mut bench, |record| record.mode.is_stopped());
    bench.run(60);
    assert!(!wire.since(start, 0x604).is_empty());
    let reports: Vec<_> = events(&mut bench).iter().map(ToString::to_string).collect();
    // The fault itself is not in the history, only the errors of the power-up test.
    let history = "error history (1003h): 8130h life guard or heartbeat error, 8250h RPDO timeout";
    assert!(reports.iter().any(|report| report == history), "{reports:?}");
}
