//! End of a run, recordings of a trip, and immunity of the torques to faults of the host.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::cell::Cell;
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::common::bench::{Wire, config, until};
use crate::common::cli::{CommandOutput, folder, frhc};
use bus::{Bus, SendError, Tap, Wake};
use canopen::NmtState;
use canopen::drive::State;
use canopen::frame::{Frame, Telegram};
use canopen_tools::candump::Line;
use config::Config;
use memory_bus::Memory;
use node::cause::{Cause, ResetReason};
use node::record::Mode;
use node::{BringUpError, Node, PowerOffError, Request};
use remote::site::VirtualSite;
use sim::scenario::Scenario;
use testbench::bench::Bench;
use testbench::world;
use units::numbering::Joint;
use units::time::Instant;

const KRAFT: &str = "config/kraft_like.toml";

/// Maximum time from the stop request to the last frame.
const STOP_LIMIT: Duration = Duration::from_secs(1);

/// The operator arms, engages and moves the hand.
const MOVES: &str = "seconds = 5\n[[console]]\nat_s = 0.05\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.1\ndeadman = true\n\
    [[move]]\nat_s = 0.15\nduration_s = 0.3\nto_m = [0.04, 0.0, 0.0]\n";

/// Returns a bench with that scenario, booted.
fn moving() -> (Bench<Wire>, Wire) {
    let wire = Wire::default();
    let script = Scenario::parse(MOVES).unwrap();
    let mut bench = Bench::new(&config(KRAFT), script, 1, wire.clone());
    bench.bring_up().unwrap();
    (bench, wire)
}

/// Stops the node and checks the order of its frames: zero torque, disable voltage, pre-operational, and no other
/// controlword.
fn stops_in_order(bench: &mut Bench<Wire>, wire: &Wire) {
    wire.clear();
    let requested = bench.node().bus().now();
    bench.shut_down().unwrap();
    let took = bench.node().bus().now().since(requested);
    assert!(took <= STOP_LIMIT, "{took:?}");
    every_drive_is_off(bench);

    // Gravity compensation ramps to zero in 50 ms; a frame may have to wait for the next cycle.
    let ramped_down = requested + Duration::from_millis(52);
    let frames = wire.all();
    let late =
        frames.iter().filter(|(at, _)| *at > ramped_down).map(|(_, telegram)| telegram.frame);
    let is_torque = |frame: &Frame| [0x201, 0x204].contains(&frame.cob_id);
    assert!(late.filter(is_torque).all(|frame| frame.data() == [0; 6]));
    let mut torques = frames.iter().map(|(_, telegram)| telegram.frame).filter(is_torque);
    assert_eq!(torques.next_back().unwrap().data(), [0; 6]);
    let frames = frames.into_iter().map(|(_, telegram)| telegram.frame);
    // Frames before the next SYNC were queued before the request.
    let frames: Vec<Frame> = frames.skip_while(|frame| frame.cob_id != 0x80).collect();
    let is_word = |frame: &Frame| (0x301..=0x306).contains(&frame.cob_id);
    let first = |what: &dyn Fn(&Frame) -> bool| frames.iter().position(what).unwrap();
    let pre_operational = first(&|frame| frame.cob_id == 0 && frame.data()[0] == 0x80);
    assert!(first(&is_torque) < pre_operational);
    for word in frames.iter().filter(|frame| is_word(frame)) {
        assert!([[0, 0], [0x80, 0]].contains(&word.data().try_into().unwrap()), "{word}");
    }
    let last_word = frames.iter().rposition(is_word);
    assert!(last_word.is_none_or(|last| first(&is_torque) < last && last < pre_operational));
    assert!(!frames[pre_operational..].iter().any(is_torque));
}

fn every_drive_is_off(bench: &Bench<Wire>) {
    for drive in bench.node().bus().stations().drives() {
        assert_eq!(drive.demand(), 0.0);
        let off = [State::SwitchOnDisabled, State::Fault];
        assert!(off.contains(&drive.state()), "{:?}", drive.state());
        assert_eq!(drive.nmt_state(), NmtState::PreOperational);
    }
}

#[test]
fn hazard_30_stop_is_orderly_within_a_second_from_every_mode() {
    for mode in Mode::ALL.into_iter().filter(|mode| *mode != Mode::Boot) {
        let (mut bench, wire) = moving();
        match mode {
            Mode::Boot | Mode::Ready => {}
            Mode::Armed | Mode::Engaged => {
                until(&mut bench, |record| record.mode == mode);
            }
            Mode::ReflectionOff | Mode::ZeroTorque | Mode::DrivesOff => {
                until(&mut bench, |record| record.mode == Mode::Engaged);
                bench.world_mut().drive_mut(Joint::of::<2>()).unwrap().fail();
                until(&mut bench, |record| record.mode.is_stopped());
                bench.run(if mode == Mode::DrivesOff { 200 } else { 1 });
            }
        }
        stops_in_order(&mut bench, &wire);
    }
}

#[test]
fn promise_12_stop_is_orderly_at_any_moment_of_a_movement() {
    for cycles in (0..7).map(|step| 53 * step) {
        let (mut bench, wire) = moving();
        until(&mut bench, |record| record.mode == Mode::Engaged);
        bench.run(cycles);
        stops_in_order(&mut bench, &wire);
    }
}

#[test]
fn promise_12_unconfirmed_drive_is_named_within_a_second() {
    let (mut bench, _) = moving();
    until(&mut bench, |record| record.mode == Mode::Engaged);
    bench.world_mut().drive_mut(Joint::of::<4>()).unwrap().unplug();
    let requested = bench.node().bus().now();
    let on = bench.shut_down().unwrap_err().statuswords.map(|word| word.is_some());
    assert_eq!(on, [false, false, false, true, false, false]);
    assert!(bench.node().bus().now().since(requested) <= STOP_LIMIT);
}

#[test]
fn hazard_30_orderly_stop_leaves_no_drive_in_fault() {
    for deadman in [false, true] {
        let (mut bench, wire) = moving();
        if deadman {
            until(&mut bench, |record| record.mode == Mode::Engaged);
        }
        bench.shut_down().unwrap();
        let ended = bench.now();
        // Longer than any watchdog: the process is gone.
        bench.fall_silent_for(Duration::from_secs(1));
        for drive in bench.node().bus().stations().drives() {
            assert_eq!(drive.state(), State::SwitchOnDisabled);
        }
        for node in 1..=6 {
            let emergencies = wire.since(ended, 0x680 + node);
            assert!(emergencies.is_empty(), "{emergencies:?}");
        }
        bench.bring_up().unwrap();
        assert!(bench.node().proof_test_report().drives.iter().all(|it| it.heartbeat.is_some()));
    }
}

#[test]
fn hazard_30_unconfirmed_drive_leaves_all_watchdogs_on() {
    let (mut bench, wire) = moving();
    until(&mut bench, |record| record.mode == Mode::Engaged);
    bench.world_mut().drive_mut(Joint::of::<4>()).unwrap().unplug();
    let requested = bench.now();
    let error = bench.shut_down().unwrap_err();
    assert!(error.to_string().contains("all drives keep their watchdogs"), "{error}");
    for node in 1..=6 {
        let writes = wire.since(requested, 0x600 + node);
        let consumer = writes.iter().filter(|(_, frame)| frame.data()[1..4] == [0x16, 0x10, 1]);
        assert_eq!(consumer.count(), 0, "node {node}");
    }
    bench.fall_silent_for(Duration::from_secs(1));
    for (at, drive) in bench.node().bus().stations().drives().iter().enumerate() {
        assert!(at == 3 || drive.state() == State::Fault, "joint {}: {:?}", at + 1, drive.state());
    }
}

#[test]
fn hazard_30_urgent_stop_confirms_power_off_alone() {
    let config = config(KRAFT);
    let wire = Wire::default();
    let mut node = node(&config, wire.clone());
    node.bring_up(&mut || false).unwrap();
    wire.clear();
    node.shut_down(&mut || true).unwrap();
    let written = wire.all().into_iter().map(|(_, telegram)| telegram.frame.cob_id);
    assert!(!written.into_iter().any(|cob_id| (0x601..=0x606).contains(&cob_id)));
    assert!(node.is_off());
}

/// Returns a node with a simulated world, outside of a bench.
fn node<T: Tap>(config: &Config, tap: T) -> Node<Memory<sim::world::World, T>, VirtualSite> {
    let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
    let world = world::build(config, Scenario::parse("seconds = 5").unwrap(), 1);
    Node::new(
        config,
        Memory::new(&bitrates, world, tap),
        VirtualSite::new(&config.remote, config.period),
    )
}

/// Returns a predicate that is true from call `n + 1` on.
fn after(n: u32) -> impl FnMut() -> bool {
    let mut calls = 0;
    move || {
        calls += 1;
        calls > n
    }
}

#[test]
fn promise_12_boot_cancelled_at_any_moment_leaves_no_drive_on() {
    let config = config(KRAFT);
    let (mut n, mut cancelled) = (0, 0);
    loop {
        let mut node = node(&config, ());
        let begun = node.bus().now();
        let booted = node.bring_up(&mut after(n));
        let took = node.bus().now().since(begun);
        match booted {
            Ok(()) => break,
            Err(error) => assert!(matches!(error, BringUpError::GivenUp), "{error}"),
        }
        cancelled += 1;
        for drive in node.bus().stations().drives() {
            let state = drive.state();
            assert!(state != State::OperationEnabled && drive.demand() == 0.0, "{n}: {state:?}");
            assert_ne!(drive.nmt_state(), NmtState::Operational, "{n}");
        }
        // The whole boot takes some seconds; a cancelled one must not take longer.
        assert!(took < Duration::from_secs(10), "{took:?}");
        n += 1 + n / 2;
    }
    assert!(cancelled > 8, "{cancelled}");
}

#[test]
fn promise_12_boot_polls_for_cancellation_every_50_ms() {
    // Long timeouts of the drives: the proof test stops SYNC or heartbeat for their whole duration.
    let text = fs::read_to_string(KRAFT).unwrap();
    let slow = text.replace("node_lost_ms = 22 ", "node_lost_ms = 200 ");
    assert_ne!(slow, text);
    let config = Config::parse(Path::new(KRAFT), &slow).unwrap();
    let wire = Wire::default();
    let mut node = node(&config, wire.clone());
    let (mut polled, mut longest, mut polls) = (Instant::ZERO, Duration::ZERO, 0);
    let mut give_up = || {
        // The frames are its clock: in the silence before the resets the polls share the time between two of them.
        polls += 1;
        if let Some((now, _)) = wire.all().last() {
            longest = longest.max(now.since(polled) / polls);
            (polled, polls) = (*now, 0);
        }
        wire.clear();
        false
    };
    node.bring_up(&mut give_up).unwrap();
    assert!(longest <= Duration::from_millis(55), "{longest:?}");
}

#[test]
fn promise_12_reset_with_a_boot_can_be_cancelled() {
    let config = config(KRAFT);
    let mut node = node(&config, ());
    node.bring_up(&mut || false).unwrap();
    // A lost drive requires a boot; the drive is plugged in again.
    node.bus_mut().stations_mut().drive_mut(Joint::of::<3>()).unwrap().unplug();
    while !node.cycle().mode.is_stopped() {}
    node.bus_mut().stations_mut().drive_mut(Joint::of::<3>()).unwrap().plug();
    let requested = node.bus().now();
    let refused = node.request(Request::Reset, &mut after(2)).unwrap_err();
    assert_eq!(refused.to_string(), "boot given up");
    assert!(node.mode().is_stopped(), "latched as before");
    // No statusword of that drive was received since it was unplugged.
    let PowerOffError { statuswords } = node.shut_down(&mut || false).unwrap_err();
    let named = statuswords.map(|statusword| statusword.is_some());
    assert_eq!(named, [false, false, true, false, false, false]);
    assert!(node.bus().now().since(requested) <= STOP_LIMIT);
}

#[test]
fn hazard_27_start_after_a_crash_enables_no_drive_until_reset() {
    let wire = Wire::default();
    let mut node = node(&config(KRAFT), wire.clone());
    let cause = Cause::AwaitsReset { reason: ResetReason::UncleanEnd };
    node.bring_up_unpowered(cause, &mut || false).unwrap();
    for _ in 0..500 {
        let record = node.cycle();
        assert_eq!((record.mode, record.targets), (Mode::DrivesOff, [0; 6]));
    }
    let record = node.cycle();
    assert_eq!((record.cause, record.sampled), (Some(cause), [true; 6]), "samples are received");
    assert!(record.output.q.iter().any(|angle| *angle != 0.0));
    let is_word = |frame: &Frame| (0x301..=0x306).contains(&frame.cob_id);
    let words = |wire: &Wire| -> Vec<u8> {
        let frames = wire.all().into_iter().map(|(_, telegram)| telegram.frame);
        frames.filter(is_word).map(|frame| frame.data()[0]).collect()
    };
    assert!(words(&wire).iter().all(|word| word & 0x0F == 0), "{:?}", words(&wire));
    for drive in node.bus().stations().drives() {
        assert_eq!(drive.state(), State::SwitchOnDisabled);
    }
    assert!(node.request(Request::Arm, &mut || false).is_err());
    let ready = node.request(Request::Reset, &mut || false).unwrap();
    assert_eq!((ready, node.cause()), (Mode::Ready, None));
    assert!(node.proof_test_report().reaction_time().is_some(), "proof test passed as at any boot");
    node.request(Request::Arm, &mut || false).unwrap();
}

#[test]
fn hazard_27_service_restarts_only_after_harmless_failures() {
    let unit = fs::read_to_string("systemd/frhc.service").unwrap();
    for line in [
        "Restart=on-failure",
        "RestartSec=2",
        "RestartPreventExitStatus=2 3 5 6",
        "StartLimitIntervalSec=0",
        "StateDirectory=frhc",
    ] {
        assert!(unit.lines().any(|one| one == line), "{line}");
    }
}

#[test]
fn hazard_27_service_shares_its_latches_with_its_group() {
    let unit = fs::read_to_string("systemd/frhc.service").unwrap();
    for line in ["Group=frhc", "StateDirectoryMode=2770", "Environment=MALLOC_ARENA_MAX=1"] {
        assert!(unit.lines().any(|one| one == line), "{line}");
    }
}

/// A bus on a host whose wall clock is stepped while the node runs.
struct SteppedClockBus<B> {
    bus: B,
    /// Number of reads; each read returns another step.
    reads: Cell<u32>,
}

impl<B: Bus> Bus for SteppedClockBus<B> {
    fn now(&self) -> Instant {
        self.bus.now()
    }

    fn wall(&self) -> Duration {
        let reads = self.reads.replace(self.reads.get() + 1);
        match reads % 3 {
            0 => self.bus.wall(),
            1 => self.bus.wall() + Duration::from_secs(86_400 * 365),
            _ => self.bus.wall() + Duration::from_secs(1),
        }
    }

    fn send_at(&mut self, now: Instant, telegram: Telegram) -> Result<(), SendError> {
        self.bus.send_at(now, telegram)
    }

    fn wait(&mut self, now: Instant, until: Instant) -> Wake {
        self.bus.wait(now, until)
    }
}

#[test]
fn hazard_31_wall_clock_step_changes_no_torque() {
    let text = fs::read_to_string(KRAFT).unwrap();
    // TIME is the only frame that contains the wall clock.
    let text = text.replacen("[node]\n", "[node]\ntime_period_ms = 50\n", 1);
    let text = text.replacen("load_limit_percent = 90", "load_limit_percent = 95", 1);
    let config = Config::parse(Path::new(KRAFT), &text).unwrap();
    let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
    let memory = |wire: &Wire| {
        let script = Scenario::parse("seconds = 5").unwrap();
        Memory::new(&bitrates, world::build(&config, script, 1), wire.clone())
    };
    let torques = |node: &mut dyn FnMut() -> [i16; 6]| -> Vec<[i16; 6]> {
        (0..600).map(|_| node()).collect()
    };
    let (plain, stepped) = (Wire::default(), Wire::default());
    let mut one =
        Node::new(&config, memory(&plain), VirtualSite::new(&config.remote, config.period));
    let bus = SteppedClockBus { bus: memory(&stepped), reads: Cell::new(0) };
    let mut other = Node::new(&config, bus, VirtualSite::new(&config.remote, config.period));
    one.bring_up(&mut || false).unwrap();
    other.bring_up(&mut || false).unwrap();
    one.request(Request::Arm, &mut || false).unwrap();
    other.request(Request::Arm, &mut || false).unwrap();
    let of_one = torques(&mut || one.cycle().targets);
    let of_other = torques(&mut || other.cycle().targets);
    assert!(of_one.iter().any(|targets| *targets != [0; 6]), "gravity was compensated");
    assert_eq!(of_one, of_other);
    assert_eq!((one.mode(), other.cause()), (Mode::Armed, None));
    let times = |wire: &Wire| wire.since(Instant::ZERO, 0x100);
    assert_ne!(times(&plain), times(&stepped), "the clock was stepped");
    assert_eq!(times(&plain).len(), times(&stepped).len());
}

/// Returns the only fault record in a folder: its path, `fault.json` and `bus.log`.
fn only_record(folder: &Path) -> (PathBuf, serde_json::Value, String) {
    let mut records = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let record = records.next().unwrap();
    assert_eq!(records.next(), None);
    let fault = fs::read(record.join("fault.json")).unwrap();
    let log = fs::read_to_string(record.join("bus.log")).unwrap();
    (record, serde_json::from_slice(&fault).unwrap(), log)
}

/// Returns the timestamp of a line in seconds.
fn stamp(line: &str) -> f64 {
    Duration::from_nanos(Line::parse(line).unwrap().nanos).as_secs_f64()
}

#[test]
fn promise_15_trip_leaves_its_cause_and_the_frames_around_it() {
    for (script, kind, joint, hazard) in [
        ("unplug", "samples-missing", Some(3), 1),
        ("sto", "drive-left", Some(1), 8),
        ("foreign_nmt", "foreign-master", None, 26),
    ] {
        let out = folder("ended", script);
        let scenario = format!("config/scenarios/faults/{script}.toml");
        let args = ["demo", "--scenario", &scenario, "--seconds", "3", "--out"];
        let ended = frhc(&[&args[..], &[out.to_str().unwrap()]].concat());
        assert_eq!(ended.code, 6, "{}", ended.stderr);
        let (record, fault, log) = only_record(&out.join("faults"));
        let name = record.display().to_string();
        assert!(ended.stderr.contains(&format!("fault record: {name}")), "at the trip");
        assert!(ended.stderr.contains(&format!("fault record      {name}")), "at the end");
        let reason = format!("frhc: stopped by {}", fault["cause"].as_str().unwrap());
        assert_eq!(ended.stderr.lines().last(), Some(&*reason));

        assert!(name.ends_with(&format!("faults/001-{}-{kind}", fault["cycle"])), "{name}");
        assert_eq!((&fault["kind"], &fault["mode_before"]), (&kind.into(), &"engaged".into()));
        assert_eq!(fault["joint"], serde_json::json!(joint));
        assert!(fault["hazards"].as_array().unwrap().contains(&hazard.into()), "{fault}");
        assert_eq!(fault["is_complete"], true);
        let before = fault["seconds_before"].as_f64().unwrap();
        let after = fault["seconds_after"].as_f64().unwrap();
        assert!(before > 1.0 && before <= 2.0, "{before}");
        assert!((after - 1.0).abs() < 0.002, "{after}");

        let tripped = fault["seconds"].as_f64().unwrap();
        let (first, last) = (log.lines().next().unwrap(), log.lines().last().unwrap());
        assert!((tripped - before - stamp(first)).abs() < 1e-6, "{first}");
        assert!((tripped + after - stamp(last)).abs() < 0.002, "{last}");
        // The log is an excerpt of the session's.
        let session = fs::read_to_string(out.join("bus.log")).unwrap();
        assert!(session.contains(&log));
        let decoded = frhc(&["decode", "--config", KRAFT, &format!("{name}/bus.log")]);
        assert_eq!(decoded.code, 0, "{}", decoded.stderr);
    }
}

#[test]
fn run_without_a_trip_leaves_no_fault_records() {
    let out = folder("ended", "no_trip");
    let ended = frhc(&["demo", "--seconds", "1", "--out", out.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(!out.join("faults").exists() && !ended.stderr.contains("fault record"));
}

/// Runs `frhc demo` for `seconds`, recorded in `out`.
fn demo(out: &Path, seconds: &str, more: &[&str]) -> CommandOutput {
    let args = ["demo", "--seconds", seconds, "--out", out.to_str().unwrap()];
    frhc(&[&args, more].concat())
}

fn summary(out: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(out.join("summary.json")).unwrap()).unwrap()
}

/// Returns whether every line is a candump line, the last one complete.
fn is_whole(log: &str) -> bool {
    log.ends_with('\n') && log.lines().all(|line| Line::parse(line).is_ok())
}

#[test]
fn hazard_32_size_limit_ends_the_recording_not_the_run() {
    let out = folder("ended", "limit").join("out");
    let limited = format!(
        "ulimit -f 100; exec {} demo --seconds 1 --out {}",
        crate::common::program(),
        out.display()
    );
    let ended = Command::new("sh").args(["-c", &limited]).output().unwrap();
    let stderr = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(4), "the recording is incomplete: {stderr}");
    assert_eq!(stderr.matches("the recording has stopped: File too large").count(), 1, "{stderr}");
    assert_eq!(stderr.matches("File too large").count(), 1, "{stderr}");
    let log = fs::read_to_string(out.join("bus.log")).unwrap();
    assert!(log.len() > 40_000 && is_whole(&log), "{} bytes", log.len());
    let summary = summary(&out);
    assert_eq!(summary["cycles"], 1_000, "the run went on to its end");
    assert!(summary["lost"].as_object().unwrap().values().all(|count| *count == 0), "{summary}");
}

#[test]
fn session_is_replaced_completely_and_only_with_force() {
    let out = folder("ended", "again");
    let unplug = ["--scenario", "config/scenarios/faults/unplug.toml"];
    assert_eq!(demo(&out, "3", &unplug).code, 6);
    let (record, ..) = only_record(&out.join("faults"));
    let log = fs::read(out.join("bus.log")).unwrap();
    let refused = demo(&out, "1", &[]);
    assert_eq!(refused.code, 2);
    assert!(refused.stderr.contains("bus.log exists; choose another path"), "{}", refused.stderr);
    assert_eq!(fs::read(out.join("bus.log")).unwrap(), log);
    let forced = demo(&out, "1", &["--force"]);
    assert_eq!(forced.code, 0, "{}", forced.stderr);
    assert!(fs::read(out.join("bus.log")).unwrap() != log && summary(&out)["cycles"] == 1_000);
    assert!(!record.exists() && !out.join("faults").exists(), "no old record beside a new log");
}

#[test]
fn session_never_follows_a_symbolic_link() {
    let out = folder("ended", "links");
    let other = out.join("other");
    fs::write(&other, "mine").unwrap();
    symlink(&other, out.join("bus.log")).unwrap();
    symlink("nowhere", out.join("summary.json")).unwrap();
    assert_eq!(demo(&out, "1", &[]).code, 2);
    assert_eq!(demo(&out, "1", &["--force"]).code, 0);
    assert_eq!(fs::read(&other).unwrap(), b"mine");
    for file in ["bus.log", "summary.json"] {
        let found = fs::symlink_metadata(out.join(file)).unwrap();
        assert_eq!((found.is_file(), found.permissions().mode() & 0o777), (true, 0o600), "{file}");
    }
}

#[test]
fn interrupted_demo_leaves_whole_lines_and_a_summary() {
    let out = folder("ended", "interrupted");
    let args = ["demo", "--realtime", "--seconds", "600", "--scenario"];
    let args = [&args[..], &["config/scenarios/faults/unplug.toml", "--out"]].concat();
    let mut command = Command::new(crate::common::program());
    let command = command.args(args).arg(&out).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.ends_with("node: ready")));
    kill(Pid::from_raw(child.id().try_into().unwrap()), Signal::SIGINT).unwrap();
    let last = lines.last().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{last}");
    assert!(last.starts_with("frhc: interrupted after "), "{last}");
    assert!(is_whole(&fs::read_to_string(out.join("bus.log")).unwrap()));
    let summary = summary(&out);
    assert_eq!(summary["is_interrupted"], true);
    assert!(summary["cycles"].as_u64().unwrap() > 0, "{summary}");
}

#[test]
fn event_has_the_same_time_on_stderr_in_log_and_record() {
    let out = folder("ended", "one_clock");
    let ended = demo(&out, "3", &["--scenario", "config/scenarios/faults/unplug.toml"]);
    let (_, fault, log) = only_record(&out.join("faults"));
    let seconds = fault["seconds"].as_f64().unwrap();
    let line = format!("{seconds:.6} s: node: zero-torque, joint 3: no sample for 3 cycles");
    assert!(ended.stderr.lines().any(|printed| printed == line), "{line}\n{}", ended.stderr);
    // The log has the end of a frame: the shortest takes 44 bits and stuffing.
    let mut syncs = log.lines().filter(|line| line.ends_with(" vcan0 080#")).map(stamp);
    assert!(syncs.any(|sync| (4.4e-5..6e-5).contains(&(sync - seconds))), "{seconds}");
    assert_eq!(fault["joint_name"], "elbow");
    assert_eq!(
        (&fault["origin"]["unix_seconds"], &summary(&out)["origin"]["unix_seconds"]),
        (&0.0.into(), &0.0.into())
    );
}
