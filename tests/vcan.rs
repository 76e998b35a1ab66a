//! Two processes on vcan, `frhc run` and `frhc sim`, and can-utils' candump.
//!
//! Needs vcan0; `scripts/test.sh` runs it under `scripts/with_vcan.sh -v`, in virtual time. The bus is the tests' clock:
//! they read candump's lines, and never sleep.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;
#[path = "vcan/far_side.rs"]
mod far_side;
#[path = "vcan/link_peer.rs"]
mod link_peer;
#[path = "vcan/realtime.rs"]
mod realtime;
#[path = "vcan/sessions.rs"]
mod sessions;
#[path = "vcan/telemetry.rs"]
mod telemetry;

use std::fs;
use std::io::{BufRead, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::Stdio;
use std::time::Duration;

use common::documented::{self, Lane};
use common::log::Log;
use common::process::{Candump, Outcome, Process, Scratch};
use common::rig::seconds;
use nix::sys::signal::Signal;

use bus::{Bus, BusEvent, SendError, SocketCan};
use canopen::drive::{State, Statusword};
use canopen::frame::{Channel, Frame, Telegram};
use canopen_tools::candump::Line;
use config::Config;
use testbench::world;

const CONFIG: &str = "config/kraft_like.toml";

/// Node-IDs of the drives in [`CONFIG`].
const NODES: std::ops::RangeInclusive<u16> = 1..=6;

/// Duration of the run after the first SYNC, in s.
const RUN_FOR: f64 = 10.2;

#[test]
fn ten_seconds_of_teleoperation_miss_no_sample() {
    let scratch = Scratch::new("teleoperation");
    let text = fs::read_to_string(CONFIG).unwrap();
    let (_, passivity) = text.split_once("[controller.passivity]").unwrap();
    let (passivity, _) = passivity.split_once("\n[").unwrap();
    let (_, friction) = text.split_once("[controller.friction]").unwrap();
    let (friction, _) = friction.split_once("\n[").unwrap();
    let config = scratch.variant(
        CONFIG,
        &[
            (&format!("[controller.friction]{friction}"), ""),
            (&format!("[controller.passivity]{passivity}"), ""),
            // The task and the arm's weight alone, so that the test can compute the torques itself.
            ("centring_n = [2.0, 2.0, 2.0]", "centring_n = [0.0, 0.0, 0.0]"),
            ("centring_nm = [0.08, 0.08, 0.08]", "centring_nm = [0.0, 0.0, 0.0]"),
            ("damping_ns_per_m = [8.0, 8.0, 8.0] ", "damping_ns_per_m = [0.0, 0.0, 0.0] "),
            ("damping_nms_per_rad = [0.02, 0.02, 0.02]", "damping_nms_per_rad = [0.0, 0.0, 0.0]"),
        ],
    );
    let session = scratch.path("session");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", "contact_10s"]);
    let run = scratch.frhc(&["run", "--config", &config, "--record", &session]);
    let first_sync = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80)).nanos;
    candump.until(|line| line.nanos > first_sync + 300_000_000);
    scratch.ctl("--wait arm").succeeds();
    candump.until(|line| line.nanos > first_sync + seconds(RUN_FOR));
    run.terminate().succeeds();
    sim.terminate().succeeds();

    let log = Log::parse(&candump.finish());
    log.has_one_exchange_a_period(0.3, RUN_FOR - 0.2, Duration::from_millis(1), NODES);
    log.ends_with_every_drive_off(NODES);

    let session = only(&session);
    let private = fs::metadata(&session).unwrap().permissions().mode() & 0o777;
    assert_eq!(private, 0o700, "only the owner may read a recording");
    let summary = fs::read_to_string(session.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["missing_samples"], 0, "{summary}");
    // Cycles of the boot, before the proof test, do not count.
    assert!(summary["cycles"].as_u64().unwrap() > 9_900, "{summary}");
    assert!(summary["contact_seconds"].as_f64().unwrap() > 2.0, "{summary}");
    assert_eq!(summary["saturated_cycles"], 0, "{summary}");

    let config = Config::load(config.as_ref()).unwrap();
    let session = fs::read_to_string(session.join("bus.log")).unwrap();
    let compared = common::felt::torques_are_those_of_the_wall(
        &session,
        &config,
        &world::arm(&config.plant()),
    );
    assert!(compared > 1_000, "only {compared} cycles in contact");
}

#[test]
fn drives_of_a_killed_node_are_torque_free_within_their_timer() {
    let timer = Duration::from_millis(5);
    // The scheduler chooses the phase of the cycle; the limit does not depend on it.
    for after_ms in [4_000, 4_613, 5_277] {
        let scratch = Scratch::new(&format!("kill-{after_ms}"));
        let mut candump = Candump::start("vcan0");
        let sim = scratch.frhc(&["sim", "--config", CONFIG, "--scenario", "contact_10s"]);
        let run = scratch.frhc(&["run", "--config", CONFIG]);
        let first_sync =
            candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80)).nanos;
        candump.until(|line| line.nanos > first_sync + 300_000_000);
        scratch.ctl("--wait arm").succeeds();
        candump.until(|line| line.nanos > first_sync + after_ms * 1_000_000);
        run.kill();
        let killed = candump.last_nanos();
        candump.until(|line| line.nanos > killed + 40_000_000);
        sim.terminate().succeeds();

        let log = Log::parse(&candump.finish());
        assert!(log.torque_sent_to(2) != 0 && log.torque_sent_to(3) != 0, "the arm was carried");
        for node in NODES {
            let stopped = log
                .torque_free_after(node)
                .unwrap_or_else(|| panic!("node {node} did not report zero torque"));
            let spare = Duration::from_micros(500);
            assert!(stopped <= timer + spare, "node {node} was torque-free after {stopped:?}");
        }
    }
}

#[test]
fn refused_run_names_the_reason_and_sends_nothing() {
    let scratch = Scratch::new("refused");
    let text = fs::read_to_string(CONFIG).unwrap();
    let cases = [
        (text.replace("vcan0", "can7"), 4, "can7: no such interface"),
        (
            text.replace("a_m = 0.254", "a_m = nan"),
            3,
            "joint[2].a_m: must be within -10..=10, got NaN",
        ),
        (text.replace("heartbeat_ms = 5", "heartbeat_s = 5"), 3, "node.heartbeat_s: unknown key"),
        (
            text.replace("layout = \"grouped\"", "layout = \"per-drive\""),
            3,
            "bus[0].load_limit_percent",
        ),
        (
            text.replace("[133.144, -0.393453, 0.0196726]", "[133.144, -3.9, 0.0196726]"),
            3,
            "stops rising",
        ),
        (text.replace("eds/frhc_drive.eds", "eds/missing.eds"), 3, "missing.eds"),
    ];
    let candump = Candump::start("vcan0");
    for (place, (text, code, reason)) in cases.into_iter().enumerate() {
        let file = scratch.write(&format!("config/case_{place}.toml"), &text);
        let outcome = scratch.frhc(&["run", "--config", &file]).wait();
        assert_eq!(outcome.code, Some(code), "{reason}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(reason), "{reason}: {}", outcome.stderr);
    }
    assert_eq!(candump.finish(), Vec::<String>::new(), "a frame was sent");
}

#[test]
fn drive_with_another_identity_is_never_enabled() {
    let scratch = Scratch::new("identity");
    let other = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let other = other.replace("0x04020010", "0x04020011");
    assert_ne!(other, fs::read_to_string("eds/frhc_drive.eds").unwrap(), "the EDS has its product");
    scratch.write("eds/frhc_drive.eds", &other);
    let text = fs::read_to_string(CONFIG).unwrap();
    let mine = scratch.write("config/mine.toml", &text.replace("0x0402_0010", "0x0402_0011"));
    never_enabled(
        &scratch,
        &["--config", CONFIG],
        &mine,
        "nodes 1, 2, 3, 4, 5 and 6: 1018h:2 is 04020010h, expected 04020011h",
    );
}

#[test]
fn drive_that_refuses_its_mapping_is_never_enabled() {
    let scratch = Scratch::new("mapping");
    let theirs = ["--config", CONFIG, "--quirks", "azimuth=fixed-mapping"];
    never_enabled(&scratch, &theirs, CONFIG, "joint 1 (azimuth), node 1: 1A00h refused: 06010002h");
}

/// Fails unless `run` with another configuration than `sim` ends with exit 5 and the reason, and starts no drive.
fn never_enabled(scratch: &Scratch, theirs: &[&str], mine: &str, reason: &str) {
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&[&["sim"], theirs].concat());
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let outcome = scratch.frhc(&["run", "--config", mine]).wait();
    assert_eq!(outcome.code, Some(5), "{}", outcome.stderr);
    assert!(outcome.stderr.contains(reason), "{reason}: {}", outcome.stderr);
    sim.terminate().succeeds();
    for line in candump.finish() {
        assert!(!line.contains(" 000#01"), "started: {line}");
        assert!(!line.contains(" 080#") && !line.contains(" 201#"), "exchanged: {line}");
    }
}

/// Runs `sim` and `commission --prove` with these options; returns the output and the outcome of the latter.
fn proven(scratch: &Scratch, theirs: &[&str], mine: &[&str]) -> (String, Outcome) {
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&[&["sim", "--config", CONFIG], theirs].concat());
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let words = [&["commission", "--config", CONFIG, "--prove", "-i", "vcan0"], mine].concat();
    let (prove, mut stdout) = scratch.frhc_and_stdout(&words);
    let mut printed = String::new();
    stdout.read_to_string(&mut printed).unwrap();
    let outcome = prove.wait();
    sim.terminate().succeeds();
    let lines = candump.finish();
    let mut torques =
        lines.iter().filter(|line| [" 201#", " 204#"].iter().any(|group| line.contains(group)));
    assert!(torques.all(|line| line.ends_with("#000000000000")), "no drive is armed");
    ends_without_power(&lines);
    (printed, outcome)
}

#[test]
fn hazard_16_proof_test_names_the_drive_that_holds_its_torque() {
    let scratch = Scratch::new("prove");
    let (table, outcome) = proven(&scratch, &[], &[]);
    outcome.succeeds();
    assert_eq!(table.matches("5 / 5.").count(), 6, "{table}");
    assert!(table.contains("max_force_n = 40 is allowed"), "{table}");

    let (json, outcome) = proven(&scratch, &[], &["--json"]);
    outcome.succeeds();
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(report["lasting_ms"].as_f64().unwrap() <= 6.0, "{json}");
    assert_eq!(report["may_arm"], true, "{json}");

    let (table, outcome) = proven(&scratch, &["--quirks", "3=holds-torque"], &[]);
    assert_eq!(outcome.code, Some(5), "{}", outcome.stderr);
    let reason = "joint 3 (elbow), node 3: kept its power stage on for 40 ms without RPDOs";
    assert!(outcome.stderr.contains(reason), "{}", outcome.stderr);
    assert!(table.contains("the arm cannot be armed"), "{table}");
}

#[test]
fn promise_12_interrupted_commissioning_leaves_all_drives_off() {
    let scratch = Scratch::new("prove-ended");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", CONFIG]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let prove = scratch.frhc(&["commission", "--config", CONFIG, "--prove", "-i", "vcan0"]);
    // The last drive is enabled: the proof test begins.
    candump.until(|line| {
        line.canopen().is_some_and(|(id, status)| id == 0x286 && status[0] & 0x6F == 0x27)
    });
    prove.signal(Signal::SIGINT);
    let outcome = prove.wait();
    assert_eq!(outcome.code, Some(5), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("boot given up"), "{}", outcome.stderr);
    sim.terminate().succeeds();
    ends_without_power(&candump.finish());
}

/// Fails unless the last statusword of every drive reports its power stage off, be it by a fault of its own.
fn ends_without_power(lines: &[String]) {
    let log = Log::parse(lines);
    for node in NODES {
        let last = log.entries().iter().rev().find(|entry| entry.id == 0x280 + node).unwrap();
        assert!(matches!(last.data[0] & 0x4F, 0x40 | 0x08), "node {node}: {last:?}");
    }
}

#[test]
fn tools_find_read_and_renumber_a_simulated_drive() {
    let scratch = Scratch::new("bench-tools");
    let mut candump = Candump::start("vcan0");
    let ended = |words: &str| {
        let mut command = std::process::Command::new(common::program());
        command.args(words.split(' ')).args(["-i", "vcan0"]).output().unwrap()
    };
    let empty = ended("scan");
    assert_eq!(empty.status.code(), Some(1));
    let reason = "frhc: no node responds; no heartbeat was received\n";
    assert_eq!(String::from_utf8_lossy(&empty.stderr), reason);
    let sim = scratch.frhc(&["sim", "--config", CONFIG]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let tool = |words: &str| {
        let ended = ended(words);
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(0), "{words}: {stderr}");
        String::from_utf8(ended.stdout).unwrap()
    };
    let found: serde_json::Value = serde_json::from_str(&tool("scan --json")).unwrap();
    let nodes = found["nodes"].as_array().unwrap().iter();
    let nodes: Vec<_> =
        nodes.map(|node| (node["node"].as_u64(), node["profile"].as_u64())).collect();
    let mut expected: Vec<_> = NODES.map(|node| (Some(u64::from(node)), Some(402))).collect();
    expected.push((Some(16), Some(401)));
    assert_eq!(nodes, expected);
    let states = found["nodes"].as_array().unwrap().iter().map(|node| node["state"].as_str());
    let asked: Vec<_> = states.map(Option::unwrap).collect();
    assert_eq!(asked, ["pre-operational"; 7], "they send no heartbeat yet");
    assert_eq!(tool("sdo read 3 1018:4 u32"), "3 0x00000003\n");
    assert_eq!(tool(&format!("sdo read elbow 1018:4 --config {CONFIG}")), "3 0x00000003\n");
    tool("nmt stop 5");
    let numbers = |words: &str| -> Vec<_> {
        let found: serde_json::Value = serde_json::from_str(&tool(words)).unwrap();
        let nodes = found["nodes"].as_array().unwrap().iter();
        nodes.map(|it| (it["node"].as_u64().unwrap(), it["state"] == "stopped")).collect()
    };
    let [unseen, seen] =
        ["scan --json --nodes 4-6", "scan --json --nodes 4-6 --stopped"].map(numbers);
    assert_eq!(unseen, [(4, false), (6, false)]);
    assert_eq!(seen, [(4, false), (5, true), (6, false)]);
    let stopped = ended(&format!("scan --nodes 5 --stopped --config {CONFIG}"));
    let reason = "node 5: is NMT-stopped and responds to no SDO request until `frhc nmt preop`";
    let stderr = String::from_utf8_lossy(&stopped.stderr);
    assert!(stopped.status.code() == Some(5) && stderr.contains(reason), "{stderr}");
    tool("nmt preop 5");
    tool("sdo write 3 6071 i16 -100 --verify");
    assert_eq!(tool("nmt reset 3 --wait"), "node 3 booted up\n");
    let taken = ended("lss configure --select 0xF8C,0x04020010,0x00010000,3 --node-id 4");
    assert_eq!(taken.status.code(), Some(5));
    let reason = "node-id 4 is in use by 00000F8Ch 04020010h 00010000h 00000004h";
    assert!(String::from_utf8_lossy(&taken.stderr).contains(reason));
    tool("lss configure --select 0xF8C,0x04020010,0x00010000,3 --node-id none --store");
    tool("nmt reset-comm 3");
    tool("lss configure --fastscan --probe 5 --node-id 33 --store");
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x721));
    assert_eq!(tool("sdo read 33 1008 vs"), "frhc simulated drive\n");
    tool("sdo write 4 1017 u16 20");
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x704));
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x704));
    sim.terminate().succeeds();
    let dead = ended("nmt start 4 --wait --timeout 300");
    assert_eq!(dead.status.code(), Some(5));
    let reason = "node 4: not confirmed within 300 ms: no frame received";
    let stderr = String::from_utf8_lossy(&dead.stderr);
    assert!(stderr.contains(reason), "{stderr}");
}

#[test]
fn tool_fails_when_its_output_cannot_be_written() {
    let scratch = Scratch::new("full-output");
    let mut candump = Candump::start("vcan0");
    let onto_full = |words: &[&str]| {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut command = std::process::Command::new(common::program());
        command.args(words).stdout(full).stderr(Stdio::piped()).spawn().unwrap()
    };
    let fails = |words: &[&str], ended: std::process::Output| {
        let stderr = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(4), "{words:?}: {stderr}");
        assert!(stderr.contains("frhc: stdout: No space left on device"), "{words:?}: {stderr}");
    };
    let sim = onto_full(&["sim", "--config", CONFIG]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    for words in [
        "scan --nodes 1-3 -i vcan0",
        "scan --json -i vcan0",
        "sdo read 3 1018:4 u32 -i vcan0",
        "nmt reset 3 --wait -i vcan0",
        "lss inquire --select 0xF8C,0x04020010,0x00010000,3 -i vcan0",
        "commission --config config/kraft_like.toml --prove -i vcan0",
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        fails(&words, onto_full(&words).wait_with_output().unwrap());
    }
    // The tool ends by itself at the first line that is lost.
    let watch = onto_full(&["nmt", "watch", "-i", "vcan0"]);
    scratch.frhc(&["nmt", "reset", "3", "--wait", "-i", "vcan0"]).wait().succeeds();
    scratch.frhc(&["nmt", "reset", "4", "--wait", "-i", "vcan0"]).wait().succeeds();
    fails(&["nmt", "watch"], watch.wait_with_output().unwrap());
    nix::sys::signal::kill(
        nix::unistd::Pid::from_raw(sim.id().try_into().unwrap()),
        Signal::SIGTERM,
    )
    .unwrap();
    fails(&["sim"], sim.wait_with_output().unwrap());
}

#[test]
fn simulated_drives_report_on_signal_and_at_the_end() {
    let scratch = Scratch::new("reports");
    let mut candump = Candump::start("vcan0");
    let (sim, mut reports) = scratch.frhc_and_stdout(&["sim", "--json", "--config", CONFIG]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let mut drives = || {
        let mut line = String::new();
        reports.read_line(&mut line).unwrap();
        let report: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert!(report["t_s"].as_f64().unwrap() >= 0.0, "{line}");
        let drives = report["drives"].as_array().unwrap().clone();
        assert_eq!(drives.len(), 6, "{line}");
        drives
    };
    sim.signal(Signal::SIGUSR1);
    let reported = drives();
    assert_eq!(reported[2]["name"], "elbow");
    assert_eq!(reported[2]["nmt"], "pre-operational");
    assert_eq!(reported[2]["state"], "switch on disabled");
    assert_eq!(reported[2]["last_error"], 0);
    Process::start("cansend", &["vcan0", "000#0103"]).wait().succeeds();
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x000));
    sim.signal(Signal::SIGQUIT);
    drives();
    sim.terminate().succeeds();
    assert_eq!(drives()[2]["nmt"], "operational");
}

#[test]
fn simulated_drives_end_when_their_interface_goes_down() {
    let scratch = Scratch::new("down");
    let words = ["sim", "--config", CONFIG, "-i", "vcan1"];
    let mut candump = Candump::start("vcan1");
    let sim = scratch.frhc(&words);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    Process::start("ip", &["link", "set", "vcan1", "down"]).wait().succeeds();
    let from_the_start = scratch.frhc(&words).wait();
    for outcome in [sim.wait(), from_the_start] {
        assert_eq!(outcome.code, Some(4), "{}", outcome.stderr);
        assert_eq!(
            outcome.stderr.matches("vcan1: interface down").count(),
            1,
            "{}",
            outcome.stderr
        );
    }
    Process::start("ip", &["link", "set", "vcan1", "up"]).wait().succeeds();
}

#[test]
fn socket_receives_data_frames_of_eleven_bits_alone() {
    let mut bus = SocketCan::open(&["vcan0".to_owned()]).unwrap();
    for frame in ["181#R", "00000181#1122", "181#1122334455667788"] {
        Process::start("cansend", &["vcan0", frame]).wait().succeeds();
    }
    let until = bus.now() + Duration::from_millis(5);
    let received = bus.receive(until).unwrap();
    let frame = Frame::new(0x181, [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88]);
    assert_eq!(received.event, BusEvent::Frame(frame));
    assert!(received.at <= bus.now());
    assert_eq!(bus.receive(until), None);
}

#[test]
fn late_frame_on_one_bus_delays_no_other_bus() {
    let names = ["vcan0", "vcan1"].map(str::to_owned);
    let (mut bus, mut other) = (SocketCan::open(&names).unwrap(), SocketCan::open(&names).unwrap());
    let frame =
        |channel| Telegram { channel: Channel(channel), frame: Frame::new(0x181, [channel]) };
    other.send(frame(1)).unwrap();
    let until = bus.now() + Duration::from_millis(1);
    other.receive(other.now() + Duration::from_millis(3));
    other.send(frame(0)).unwrap();
    let received = bus.receive(until).unwrap();
    assert_eq!((received.channel, received.event), (Channel(1), BusEvent::Frame(frame(1).frame)));
    assert_eq!(bus.receive(until), None, "the other came later");
    let later = bus.now() + Duration::from_millis(1);
    assert_eq!(bus.receive(later).unwrap().channel, Channel(0));
}

#[test]
fn hazard_24_run_and_commission_refuse_an_interface_down() {
    let scratch = Scratch::new("down");
    Process::start("ip", &["link", "set", "vcan1", "down"]).wait().succeeds();
    for words in [&["run"][..], &["commission", "--prove"]] {
        let args = [words, &["--config", CONFIG, "-i", "vcan1"]].concat();
        let outcome = scratch.frhc(&args).wait();
        assert_eq!(outcome.code, Some(4), "{words:?}: {}", outcome.stderr);
        let reason = "vcan1: the interface is down (ip link set vcan1 up)";
        assert!(outcome.stderr.contains(reason), "{words:?}: {}", outcome.stderr);
    }
    Process::start("ip", &["link", "set", "vcan1", "up"]).wait().succeeds();
}

#[test]
fn receive_ends_at_its_deadline() {
    let mut bus = SocketCan::open(&["vcan0".to_owned()]).unwrap();
    bus::realtime::ask();
    for micros in [100, 1_000, 12_345] {
        let until = bus.now() + Duration::from_micros(micros);
        assert_eq!(bus.receive(until), None);
        let late = bus.now().since(until);
        assert!(bus.now() >= until && late < Duration::from_micros(10), "{late:?} late");
    }
}

#[test]
fn interface_that_goes_down_is_reported_and_accepts_no_frame() {
    let mut bus = SocketCan::open(&["vcan1".to_owned()]).unwrap();
    Process::start("ip", &["link", "set", "vcan1", "down"]).wait().succeeds();
    let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x80, []) };
    let event = bus.receive(bus.now() + Duration::from_millis(5)).map(|received| received.event);
    assert_eq!(event, Some(BusEvent::Error(bus::BusError::Down)));
    assert_eq!(bus.send(telegram), Err(SendError::Down));
    Process::start("ip", &["link", "set", "vcan1", "up"]).wait().succeeds();
}

/// An unused COB-ID, whose frames mark a time in the log.
const NOW: u16 = 0x7FE;

/// Ends `run`, and fails unless it ends within a second with every drive off.
fn ends_in_order(mut candump: Candump, run: Process, sim: Process, signals: &[Signal]) -> String {
    Process::start("cansend", &["vcan0", "7FE#"]).wait().succeeds();
    let signalled = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == NOW)).nanos;
    signals.iter().for_each(|signal| run.signal(*signal));
    let outcome = run.wait();
    outcome.succeeds();
    Process::start("cansend", &["vcan0", "7FE#"]).wait().succeeds();
    let gone = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == NOW)).nanos;
    let took = Duration::from_nanos(gone - signalled);
    assert!(took <= Duration::from_secs(1), "{took:?}");
    sim.terminate().succeeds();
    Log::parse(&candump.finish()).ends_with_every_drive_off(NODES);
    outcome.stderr
}

/// Runs `sim` and `run` until the arm is armed and moves; the log of `run` goes to `stderr`.
fn carried(scratch: &Scratch, stderr: impl Into<Stdio>) -> (Candump, Process, Process) {
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", CONFIG, "--scenario", "contact_10s"]);
    let run = scratch.frhc_onto(&["run", "--config", CONFIG], stderr);
    let first_sync = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80)).nanos;
    candump.until(|line| line.nanos > first_sync + 300_000_000);
    scratch.ctl("--wait arm").succeeds();
    candump.until(|line| line.nanos > first_sync + 4_000_000_000);
    (candump, run, sim)
}

#[test]
fn hazard_30_stopping_signals_end_a_run_within_a_second() {
    let scratch = Scratch::new("signals");
    let (mut candump, run, sim) = carried(&scratch, Stdio::piped());
    run.signal(Signal::SIGHUP);
    let begun = candump.last_nanos();
    candump.until(|line| line.nanos > begun + 200_000_000);
    scratch.ctl("status").succeeds();
    let log = ends_in_order(candump, run, sim, &[Signal::SIGTERM, Signal::SIGINT]);
    assert!(log.contains("SIGHUP: ignored"), "{log}");
    assert!(log.contains("stopping signal=\"SIGTERM\""), "{log}");
}

#[test]
fn hazard_30_terminated_run_leaves_no_drive_in_fault() {
    let scratch = Scratch::new("no-fault");
    let (mut candump, run, sim) = carried(&scratch, Stdio::piped());
    run.terminate().succeeds();
    // Longer than any watchdog of the drives.
    let ended = candump.mark().nanos;
    candump.until(|line| line.nanos > ended + 500_000_000);
    for node in NODES {
        let read = format!("sdo read {node} 6041 u16 -i vcan0");
        let read = std::process::Command::new(common::program()).args(read.split(' ')).output();
        let stdout = String::from_utf8(read.unwrap().stdout).unwrap();
        let (_, raw) = stdout.trim().rsplit_once("0x").unwrap();
        let statusword = Statusword(u16::from_str_radix(raw, 16).unwrap());
        assert_eq!(statusword.state(), Some(State::SwitchOnDisabled), "node {node}: {stdout}");
    }
    sim.terminate().succeeds();
    let log = candump.finish();
    // 681h to 686h: emergencies.
    let late: Vec<_> = log
        .iter()
        .filter_map(|line| Line::parse(line).ok())
        .filter(|line| line.nanos > ended)
        .filter(|line| line.canopen().is_some_and(|(id, _)| (0x681..=0x686).contains(&id)))
        .collect();
    assert!(late.is_empty(), "{late:?}");
}

#[test]
fn run_without_a_switch_box_proves_and_refuses_to_arm() {
    let scratch = Scratch::new("no-switch-box");
    let text = fs::read_to_string(CONFIG).unwrap();
    let (_, section) = text.split_once("\n[switches]\n").unwrap();
    let (section, _) = section.split_once("\n[controller]\n").unwrap();
    let config = scratch.variant(CONFIG, &[(&format!("\n[switches]\n{section}"), "")]);
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", "contact_10s"]);
    let run = scratch.frhc(&["run", "--config", &config]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80));
    let refused = scratch.ctl("--wait arm");
    assert_ne!(refused.code, Some(0));
    assert!(refused.stderr.contains("there is no deadman; add [switches]"), "{}", refused.stderr);
    let ended = run.terminate();
    ended.succeeds();
    assert!(ended.stderr.contains("nothing can be armed"), "{}", ended.stderr);
    assert!(ended.stderr.contains("ready: all drives enabled"), "{}", ended.stderr);
    sim.terminate().succeeds();
    let log = Log::parse(&candump.finish());
    log.ends_with_every_drive_off(NODES);
}

#[test]
fn hazard_32_limit_of_file_size_ends_the_recording_alone() {
    let scratch = Scratch::new("file-size");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", CONFIG, "--scenario", "contact_10s"]);
    let session = scratch.path("session");
    let run =
        scratch.frhc_under("ulimit -f 500", &["run", "--config", CONFIG, "--record", &session]);
    scratch.ctl("--wait arm").succeeds();
    let armed = candump.mark().nanos;
    candump.until(|line| line.nanos > armed + 3_000_000_000);
    scratch.ctl("disarm").succeeds();
    let outcome = run.terminate();
    assert_eq!(outcome.code, Some(4), "the recording is incomplete: {}", outcome.stderr);
    assert_eq!(
        outcome.stderr.matches("the recording has stopped").count(),
        1,
        "{}",
        outcome.stderr
    );
    sim.terminate().succeeds();
    Log::parse(&candump.finish()).ends_with_every_drive_off(NODES);
}

/// A file system in a file, which [`freeze`](Self::freeze) makes a disk that hangs: every write blocks.
struct Disk {
    path: String,
    is_frozen: bool,
}

impl Disk {
    fn in_folder(scratch: &Scratch) -> Self {
        let (image, path) = (scratch.path("disk.img"), scratch.path("disk"));
        let format = "truncate -s 64M $0 && mkfs.ext4 -q $0 && mkdir $1 && mount -o loop $0 $1";
        Process::start("sh", &["-c", format, &image, &path]).wait().succeeds();
        Self { path, is_frozen: false }
    }

    fn freeze(&mut self) {
        Process::start("fsfreeze", &["-f", &self.path]).wait().succeeds();
        self.is_frozen = true;
    }

    fn thaw(&mut self) {
        if std::mem::take(&mut self.is_frozen) {
            Process::start("fsfreeze", &["-u", &self.path]).wait().succeeds();
        }
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        self.thaw();
        Process::start("umount", &["-l", &self.path]).wait();
    }
}

#[test]
fn hazard_32_disk_that_hangs_delays_the_end_by_a_second() {
    let scratch = Scratch::new("hung-disk");
    let mut disk = Disk::in_folder(&scratch);
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", CONFIG, "--scenario", "contact_10s"]);
    let session = format!("{}/session", disk.path);
    let stderr = scratch.path("stderr");
    let words = ["run", "--config", CONFIG, "--record", &session];
    let run = scratch.frhc_onto(&words, fs::File::create(&stderr).unwrap());
    scratch.ctl("--wait arm").succeeds();
    let armed = candump.mark().nanos;
    candump.until(|line| line.nanos > armed + 1_000_000_000);
    disk.freeze();
    let frozen = candump.mark().nanos;
    candump.until(|line| line.nanos > frozen + 1_000_000_000);
    let signalled = candump.mark().nanos;
    run.signal(Signal::SIGTERM);
    // The switch box sends on.
    candump.until(|line| line.nanos > signalled + 1_000_000_000);
    let main = run.state_of_main_thread();
    let printed = fs::read_to_string(&stderr).unwrap();
    // No signal ends a thread in a write that the kernel does not interrupt: it keeps the process.
    disk.thaw();
    let outcome = run.wait();
    assert_eq!(main, 'Z', "the main thread has ended: {printed}");
    assert_eq!(outcome.code, Some(4), "the recording is incomplete: {printed}");
    assert_eq!(printed.matches("given up: the disk did not respond").count(), 1, "{printed}");
    assert!(printed.lines().last().unwrap().contains("given up"), "{printed}");
    sim.terminate().succeeds();
    let log = Log::parse(&candump.finish());
    let is_off = |entry: &&common::log::Entry| entry.id == 0 && entry.data.first() == Some(&0x80);
    let off = log.entries().iter().find(|entry| is_off(entry) && entry.nanos > signalled);
    let off = Duration::from_nanos(off.unwrap().nanos - signalled);
    assert!(off <= Duration::from_millis(200), "{off:?}");
    log.ends_with_every_drive_off(NODES);
}

#[test]
fn promise_12_full_console_and_terminal_delay_no_stop() {
    let scratch = Scratch::new("stopped");
    let (_unread, mut full) = UnixStream::pair().unwrap();
    full.set_nonblocking(true).unwrap();
    while full.write_all(b".").is_ok() {}
    full.set_nonblocking(false).unwrap();
    let (candump, run, sim) = carried(&scratch, OwnedFd::from(full));
    let mut client = UnixStream::connect(scratch.path("frhc/node.sock")).unwrap();
    client.set_nonblocking(true).unwrap();
    while client.write_all(b"{\"ask\":\"status\"}\n").is_ok() {}
    ends_in_order(candump, run, sim, &[Signal::SIGTERM]);
}

#[test]
fn promise_12_boot_ended_by_a_signal_starts_no_drive() {
    let scratch = Scratch::new("boot-ended");
    let mut candump = Candump::start("vcan0");
    // One drive is slow: in virtual time the boot of the others would end before the signal.
    let slow = ["--quirks", "elbow=slow-sdo"];
    let sim = scratch.frhc(&[&["sim", "--config", CONFIG][..], &slow].concat());
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let run = scratch.frhc(&["run", "--config", CONFIG]);
    let asked = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x606)).nanos;
    run.terminate().succeeds();
    Process::start("cansend", &["vcan0", "7FE#"]).wait().succeeds();
    let gone = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == NOW)).nanos;
    assert!(gone - asked < seconds(1.0), "{} ns", gone - asked);
    sim.terminate().succeeds();
    let log = candump.finish();
    assert!(!log.iter().any(|line| line.contains(" 000#01") || line.contains(" 201#")));
}

#[test]
fn promise_15_stop_without_a_recording_is_in_the_state_folder() {
    let scratch = Scratch::new("state");
    let (mut candump, run, sim) = carried(&scratch, Stdio::piped());
    sim.kill();
    let killed = candump.last_nanos();
    candump.until(|line| line.nanos > killed + 1_500_000_000);
    let outcome = run.terminate();
    assert_eq!(outcome.code, Some(6), "{}", outcome.stderr);
    let folder = scratch.path("state/faults");
    let record = only(&folder);
    assert!(outcome.stderr.contains(&format!("fault record: {}", record.display())));
    let fault = fs::read_to_string(record.join("fault.json")).unwrap();
    let fault: serde_json::Value = serde_json::from_str(&fault).unwrap();
    assert_eq!((&fault["kind"], &fault["is_complete"]), (&"samples-missing".into(), &true.into()));
    let log = fs::read_to_string(record.join("bus.log")).unwrap();
    assert!(log.lines().count() > 10_000 && log.contains(" node0 "), "{}", log.lines().count());

    // The same time on stderr, in the document, and with the origin in the log.
    let tripped = fault["seconds"].as_f64().unwrap();
    let line = format!("{tripped:.6} s  WARN mode mode=zero-torque");
    assert!(outcome.stderr.lines().any(|one| one.starts_with(&line)), "{}", outcome.stderr);
    let origin = &fault["origin"];
    let first = format!("INFO time counts from {} (", origin["utc"].as_str().unwrap());
    assert!(outcome.stderr.contains(&first), "{}", outcome.stderr);
    let syncs = log.lines().map(|line| Line::parse(line).unwrap());
    let syncs = syncs.filter(|line| line.canopen().is_some_and(|(id, _)| id == 0x80));
    let expected = origin["unix_seconds"].as_f64().unwrap() + tripped;
    let mut stamps = syncs.map(|line| Duration::from_nanos(line.nanos).as_secs_f64());
    assert!(stamps.any(|stamp| (stamp - expected).abs() < 1e-4), "a SYNC at {expected}");
}

#[test]
fn second_recording_leaves_the_first_unchanged() {
    let scratch = Scratch::new("recordings");
    let parent = scratch.path("recordings");
    let record = || {
        let mut candump = Candump::start("vcan0");
        let sim = scratch.frhc(&["sim", "--config", CONFIG]);
        let run = scratch.frhc(&["run", "--config", CONFIG, "--record", &parent]);
        candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80));
        let outcome = run.terminate();
        outcome.succeeds();
        sim.terminate().succeeds();
        outcome.stderr
    };
    let log = record();
    let first = only(&parent);
    assert!(log.contains(&format!("recording in {}", first.display())), "{log}");
    let log = fs::read(first.join("bus.log")).unwrap();
    record();
    assert_eq!(fs::read_dir(&parent).unwrap().count(), 2);
    assert_eq!(fs::read(first.join("bus.log")).unwrap(), log);
}

/// Returns the only entry of a folder.
fn only(folder: &str) -> PathBuf {
    let mut entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let entry = entries.next().unwrap();
    assert_eq!(entries.next(), None, "one entry");
    entry
}

/// Quirk of the elbow's drive, and the reason for which it is refused; none if it runs.
const REAL_DRIVES: [(&str, &str); 5] = [
    ("no-rtr", ""),
    ("lost-sdo-reply", ""),
    ("polarity-reversed", "polarity (607Eh) is 80h, expected 00h"),
    ("stored:6091h:1=2", "gear ratio (6091h) is 2:1, expected 1:1"),
    ("stored:6076h=176500", "rated torque (6076h) is 176500 mN·m, expected 130.7 mN·m"),
];

#[test]
fn manners_of_real_drives_are_met_or_refused_with_both_values() {
    const SLOW: &str = "config/kraft_like_500hz.toml";
    for (quirk, reason) in REAL_DRIVES {
        let scratch = Scratch::new("real_drives");
        let sim = scratch.frhc(&["sim", "--config", SLOW, "--quirks", &format!("elbow={quirk}")]);
        let run = scratch.frhc(&["run", "--config", SLOW]);
        if reason.is_empty() {
            scratch.ctl("--wait arm").succeeds();
            run.terminate().succeeds();
        } else {
            let outcome = run.wait();
            assert_eq!(outcome.code, Some(5), "{quirk}: {}", outcome.stderr);
            assert!(outcome.stderr.contains(reason), "{quirk}: {}", outcome.stderr);
        }
        sim.terminate().succeeds();
    }
}

/// The other `sh` blocks: see `tests/program/documented.rs`.
#[test]
fn sh_blocks_of_the_documentation_run_as_written() {
    let scratch = Scratch::new("documented");
    let count = documented::run(scratch.path("").as_ref(), |lane| match lane {
        Lane::Vcan(before) => Some(before),
        Lane::AnyMachine | Lane::Session | Lane::Network(_) | Lane::NotRun(_) => None,
    });
    assert!(count > 10, "{count}");
}

/// Returns time in s, level and text of a line of the log.
fn logged(line: &str) -> Option<(f64, &str, &str)> {
    let (seconds, rest) = line.split_once(" s ")?;
    let (level, text) = rest.trim_start().split_once(' ')?;
    Some((seconds.parse().ok()?, level, text))
}

#[test]
fn boot_is_logged_while_it_happens_in_its_order() {
    let scratch = Scratch::new("boot-log");
    let sim = scratch.frhc(&["sim", "--config", CONFIG]);
    let run = scratch.frhc(&["run", "--config", CONFIG]);
    scratch.ctl("--wait arm").succeeds();
    let ended = run.terminate();
    sim.terminate().succeeds();
    ended.succeeds();
    let lines: Vec<_> = ended.stderr.lines().filter_map(logged).collect();
    let times = |text: &str| -> Vec<f64> {
        let found = lines.iter().filter(|(_, level, line)| *level == "INFO" && line.contains(text));
        found.map(|(seconds, ..)| *seconds).collect()
    };
    let stages = [
        (": configuration downloaded", 7),
        ("network: every node is operational", 1),
        (": proof test of its watchdog: emergency 8250h", 6),
        (": proof test of its watchdog: emergency 8130h", 6),
        ("ready: all drives enabled at zero torque", 1),
    ];
    let mut end_of_last = 0.0;
    for (text, count) in stages {
        let times = times(text);
        assert_eq!(times.len(), count, "{text}: {}", ended.stderr);
        assert!(times[0] > end_of_last, "{text} at {} s: {}", times[0], ended.stderr);
        end_of_last = *times.last().unwrap();
    }
    // The log is in the order of the times that it prints.
    assert!(lines.is_sorted_by_key(|(seconds, ..)| *seconds), "{}", ended.stderr);
    assert!(!lines.iter().any(|(_, level, _)| *level == "WARN"), "{}", ended.stderr);
}
