//! Drives that are refused, or fail their proof test: no power stage is left on.

use std::io::Read;

use crate::common::log::{Log, NODES};
use crate::common::prelude::*;
use crate::common::process::Outcome;
use nix::sys::signal::Signal;

#[test]
fn refused_run_names_the_reason_and_sends_nothing() {
    let scratch = Scratch::new("refused");
    let text = fs::read_to_string(KRAFT).unwrap();
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
    let text = fs::read_to_string(KRAFT).unwrap();
    let mine = scratch.write("config/mine.toml", &text.replace("0x0402_0010", "0x0402_0011"));
    never_enabled(
        &scratch,
        &["--config", KRAFT],
        &mine,
        "nodes 1, 2, 3, 4, 5 and 6: 1018h:2 is 04020010h, expected 04020011h",
    );
}

#[test]
fn drive_that_refuses_its_mapping_is_never_enabled() {
    let scratch = Scratch::new("mapping");
    let theirs = ["--config", KRAFT, "--quirks", "azimuth=fixed-mapping"];
    never_enabled(&scratch, &theirs, KRAFT, "joint 1 (azimuth), node 1: 1A00h refused: 06010002h");
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
    let sim = scratch.frhc(&[&["sim", "--config", KRAFT], theirs].concat());
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let words = [&["commission", "--config", KRAFT, "--prove", "-i", "vcan0"], mine].concat();
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
    let report: Value = serde_json::from_str(&json).unwrap();
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
    let sim = scratch.frhc(&["sim", "--config", KRAFT]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let prove = scratch.frhc(&["commission", "--config", KRAFT, "--prove", "-i", "vcan0"]);
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
