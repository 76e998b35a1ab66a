//! End of a run, recordings of a trip, and immunity of the torques to faults of the host.

use std::cell::Cell;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{PermissionsExt, symlink};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::common::prelude::*;
use crate::orderly_stop::node;
use bus::{SendError, Wake};
use canopen_tools::candump::Line;
use node::Node;
use node::cause::ResetReason;
use remote::site::VirtualSite;

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

    fn wait(&mut self, now: Instant, from: Instant, until: Instant) -> Wake {
        self.bus.wait(now, from, until)
    }
}

#[test]
fn hazard_31_wall_clock_step_changes_no_torque() {
    let text = fs::read_to_string(KRAFT).unwrap();
    // TIME is the only frame that contains the wall clock.
    let text = text.replacen("[node]\n", "[node]\ntime_period_ms = 50\n", 1);
    let text = text.replacen("load_limit_percent = 90", "load_limit_percent = 95", 1);
    let config = parse(KRAFT, &text);
    let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
    let memory = |wire: &Wire| {
        let script = script("seconds = 5");
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
fn only_record(folder: &Path) -> (PathBuf, Value, String) {
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

fn summary(out: &Path) -> Value {
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
