//! `frhc decode` and `frhc export dbc` as programs.
//!
//! `GOLDEN=write cargo test --test program decode::` rewrites the transcript; run it after the golden tests.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Output};

use serde_json::Value as Json;

use crate::common::prelude::*;

const LOG: &str = "tests/golden/boot.log";

fn frhc(args: &[&str]) -> Command {
    let mut command = Command::new(crate::common::program());
    command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Output of a command with `input` on stdin.
fn piped(args: &[&str], input: &str) -> Output {
    let mut child = frhc(args).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_owned();
    let feeder = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap().unwrap();
    output
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn decoded(args: &[&str]) -> String {
    let output = frhc(args).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn golden_boot_is_decoded() {
    let output = decoded(&["decode", "--config", KRAFT_500HZ, LOG]);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/decode_boot.txt");
    if std::env::var_os("GOLDEN").is_some_and(|word| word == "write") {
        fs::write(path, output).unwrap();
        return;
    }
    let golden = fs::read_to_string(&path).unwrap();
    for (number, (is, was)) in (1..).zip(output.lines().zip(golden.lines())) {
        assert_eq!(is, was, "decode_boot.txt:{number}");
    }
    assert_eq!(output.lines().count(), golden.lines().count());
}

#[test]
fn every_line_of_the_log_is_kept() {
    let log = fs::read_to_string(LOG).unwrap();
    for args in [&["decode", LOG][..], &["decode", "--config", KRAFT_500HZ, LOG]] {
        let output = decoded(args);
        assert_eq!(output.lines().count(), log.lines().count());
        for (output, was) in output.lines().zip(log.lines()) {
            assert!(output.starts_with(was), "{output}");
        }
    }
}

#[test]
fn line_from_a_pipe_is_decoded_at_once() {
    let mut child = frhc(&["decode", "--config", KRAFT_500HZ]).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    for (line, says) in
        [("  can0  703   [1]  00\n", "boot-up"), ("  can0  703   [1]  05\n", "operational")]
    {
        stdin.write_all(line.as_bytes()).unwrap();
        let mut output = String::new();
        stdout.read_line(&mut output).unwrap();
        assert!(output.contains("heartbeat elbow") && output.contains(says), "{output}");
    }
    drop(stdin);
    assert!(child.wait().unwrap().success());
}

#[test]
fn closed_output_is_not_an_error() {
    let mut child: Child = frhc(&["decode"]).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let log = fs::read_to_string(LOG).unwrap();
    let feeder = std::thread::spawn(move || while stdin.write_all(log.as_bytes()).is_ok() {});
    let mut first = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
    let mut stderr = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    assert_eq!((child.wait().unwrap().code(), stderr.as_str()), (Some(0), ""));
    feeder.join().unwrap();
}

#[test]
fn invalid_lines_are_reported_by_number_and_skipped() {
    let output = piped(&["decode"], "hello there\n(1.000000) can0 703#00\n(1.000000) can0 703#0\n");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(text(&output.stdout).lines().count(), 3);
    let stderr = text(&output.stderr);
    assert!(
        stderr.contains("stdin:1: no identifier") && stderr.contains("stdin:3: no data"),
        "{stderr}"
    );
    assert!(stderr.ends_with("stdin: 2 of 3 lines are not candump lines\n"), "{stderr}");

    let output = piped(&["decode"], "nothing\nat all\n");
    assert_eq!(output.status.code(), Some(1));
    assert!(piped(&["decode"], "").status.success(), "empty input is valid");
    assert_eq!(frhc(&["decode", "/nowhere.log"]).output().unwrap().status.code(), Some(4));
}

#[test]
fn report_of_garbage_is_short() {
    // About a thousand lines of pseudo-random bytes.
    let byte = |n: u32| n.wrapping_mul(2_654_435_761).to_be_bytes()[0];
    let garbage: Vec<u8> = (0..300_000).map(byte).collect();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("garbage.bin");
    fs::write(&path, garbage).unwrap();
    let output = frhc(&["decode", path.to_str().unwrap()]).output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr.lines().count() < 10, "{stderr}");
    let name = path.display();
    let last = stderr.lines().last().unwrap();
    assert!(stderr.starts_with(&format!("frhc: {name}:1: no ")), "{stderr}");
    assert!(last.starts_with(&format!("frhc: {name}: none of ")), "{stderr}");
}

#[test]
fn unreadable_log_is_named() {
    for name in ["/nowhere.log", "/proc"] {
        let output = frhc(&["decode", name]).output().unwrap();
        assert_eq!(output.status.code(), Some(4), "{name}");
        assert!(text(&output.stderr).starts_with(&format!("frhc: {name}: ")), "{output:?}");
    }
}

#[test]
fn backward_time_stamp_is_marked() {
    let log = "(2.000000) can0 703#05\n(2.000100) wrench0 18FF0000##000\n(0.500000) can0 703#05\n\
        (0.600000) can0 703#05\n(1.000000) wrench0 18FF0000##000\n";
    let output = piped(&["decode"], log);
    let marks = text(&output.stdout).lines().map(|line| line.split("  ! ").nth(1));
    let marks: Vec<_> = marks.collect();
    let [back, other] =
        ["timestamp goes back 1.500000 s", "timestamp goes back 1.000100 s"].map(Some);
    assert_eq!(marks, [None, None, back, None, other]);
    let json = piped(&["decode", "--json"], log);
    let third: Json = serde_json::from_str(text(&json.stdout).lines().nth(2).unwrap()).unwrap();
    assert_eq!(third["remarks"], serde_json::json!(["timestamp goes back 1.500000 s"]));
}

#[test]
fn raw_data_length_codes_are_parsed() {
    let input =
        "(1.000000) can0 703#1122334455667788_E\n  can0  703   {B}  11 22 33 44 55 66 77 88\n";
    let output = piped(&["decode", "--json"], input);
    assert_eq!(text(&output.stderr), "");
    let dlc = |line| serde_json::from_str::<Json>(line).unwrap()["dlc"].clone();
    let codes: Vec<Json> = text(&output.stdout).lines().map(dlc).collect();
    assert_eq!(codes, [14, 11]);
}

#[test]
fn log_and_screen_format_decode_alike() {
    let log = fs::read_to_string(LOG).unwrap();
    let screen: Vec<String> = log.lines().map(on_screen).collect();
    let output = piped(&["decode", "--config", KRAFT_500HZ], &(screen.join("\n") + "\n"));
    let behind = |output: &str, line: &str| output[line.len()..].trim_start().to_owned();
    let of_log = decoded(&["decode", "--config", KRAFT_500HZ, LOG]);
    let lines = text(&output.stdout).lines().zip(&screen).zip(of_log.lines().zip(log.lines()));
    for ((screen, line), (output, was)) in lines {
        assert_eq!(behind(screen, line), behind(output, was));
    }
}

/// Line of a log in the format of `candump -ta`.
fn on_screen(line: &str) -> String {
    let mut words = line.split(' ');
    let (stamp, interface) = (words.next().unwrap(), words.next().unwrap());
    let (id, data) = words.next().unwrap().split_once('#').unwrap();
    let pairs: Vec<&str> = data.as_bytes().chunks(2).map(text).collect();
    format!(" {stamp}  {interface}  {id}   [{}]  {}", pairs.len(), pairs.join(" "))
}

#[test]
fn only_shows_the_lines_of_a_joint() {
    let output = decoded(&["decode", "--config", KRAFT_500HZ, "--only", "elbow", LOG]);
    assert!(output.lines().count() > 50);
    for line in output.lines() {
        assert!(
            line.contains("elbow") || line.contains("node 3") || line.contains("every node"),
            "{line}"
        );
    }
    let wrong = frhc(&["decode", "--config", KRAFT_500HZ, "--only", "knee", LOG]).output().unwrap();
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        text(&wrong.stderr)
            .contains("--only knee: unknown node; expected azimuth, elevation, elbow")
    );
}

/// Position and scaling of a signal in a DBC file.
struct Signal {
    start: u32,
    bits: u32,
    is_signed: bool,
    step: f64,
    offset: f64,
}

impl Signal {
    /// Physical value.
    fn value(&self, data: &[u8]) -> f64 {
        let bit =
            |place: u32| u64::from(data[usize::try_from(place / 8).unwrap()] >> (place % 8) & 1);
        let raw = (0..self.bits).fold(0, |raw, place| raw | bit(self.start + place) << place);
        let is_negative = self.is_signed && raw >> (self.bits - 1) == 1;
        let magnitude = if is_negative { (1 << self.bits) - raw } else { raw };
        let magnitude = f64::from(u32::try_from(magnitude).unwrap());
        let raw = if is_negative { -magnitude } else { magnitude };
        raw * self.step + self.offset
    }
}

/// Signals of a DBC file by CAN identifier.
fn signals(dbc: &str) -> HashMap<u32, HashMap<String, Signal>> {
    let mut messages: HashMap<u32, HashMap<String, Signal>> = HashMap::new();
    let mut id = 0;
    for line in dbc.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["BO_", number, ..] => id = number.parse().unwrap(),
            ["SG_", name, ":", place, scale, ..] => {
                let (start, rest) = place.split_once('|').unwrap();
                let (bits, kind) = rest.split_once('@').unwrap();
                let (step, offset) = scale[1..scale.len() - 1].split_once(',').unwrap();
                let signal = Signal {
                    start: start.parse().unwrap(),
                    bits: bits.parse().unwrap(),
                    is_signed: kind == "1-",
                    step: step.parse().unwrap(),
                    offset: offset.parse().unwrap(),
                };
                messages.entry(id).or_default().insert((*name).to_owned(), signal);
            }
            _ => {}
        }
    }
    messages
}

#[test]
fn dbc_file_scales_like_the_decoder() {
    let messages = signals(&decoded(&["export", "dbc", "--config", KRAFT_500HZ]));
    let output = [LOG, "tests/golden/fault_reset.log"]
        .map(|log| decoded(&["decode", "--config", KRAFT_500HZ, "--json", log]))
        .concat();
    let mut compared = 0;
    for line in output.lines() {
        let line: Json = serde_json::from_str(line).unwrap();
        let Some(values) = line["signals"].as_object() else { continue };
        let id = u32::from_str_radix(line["id"].as_str().unwrap(), 16).unwrap();
        let digits = line["data"].as_str().unwrap().as_bytes().chunks(2);
        let data: Vec<u8> =
            digits.map(|pair| u8::from_str_radix(text(pair), 16).unwrap()).collect();
        for (name, value) in values {
            if let Some(signal) = messages[&id].get(name) {
                let difference = signal.value(&data) - value.as_f64().unwrap();
                assert!(difference.abs() < 1e-12, "{name}: {difference} apart in {line}");
                compared += 1;
            }
        }
    }
    assert!(compared > 100, "{compared} signals");
}

#[test]
fn export_is_limited_to_one_bus() {
    let config = JPL;
    let all = signals(&decoded(&["export", "dbc", "--config", config]));
    let wrist = signals(&decoded(&["export", "dbc", "--config", config, "--bus", "wrist"]));
    assert!(all.contains_key(&0x181) && all.contains_key(&0x184));
    assert!(!wrist.contains_key(&0x181) && wrist.contains_key(&0x184));
    let wrong = frhc(&["export", "dbc", "--config", config, "--bus", "hip"]).output().unwrap();
    assert_eq!(wrong.status.code(), Some(2));
}
