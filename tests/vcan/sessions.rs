//! Sessions of `frhc run`, replayed, and candump beside the run as the judge of what the node has sent.

use std::fs;
use std::io::Read;
use std::path::PathBuf;

use serde_json::Value;

use crate::common::process::{Candump, Scratch};
use crate::common::rig::seconds;
use canopen_tools::candump::Line;

const CONFIG: &str = "config/kraft_like.toml";

/// Identifiers that only the master sends: NMT, SYNC, torques, controlwords, SDO requests, heartbeat.
fn is_masters(id: u32) -> bool {
    matches!(id, 0x000 | 0x080 | 0x100 | 0x201..=0x27F | 0x301..=0x37F | 0x600..=0x67F | 0x77F)
}

/// Returns the frames of the master in a log, without stamps.
fn of_master<'l>(lines: impl IntoIterator<Item = &'l str>) -> Vec<String> {
    let parsed = lines.into_iter().map(|text| (Line::parse(text).unwrap(), text));
    let of_master = parsed.filter(|(line, _)| is_masters(line.id));
    of_master.map(|(_, text)| text.split_once(' ').unwrap().1.to_owned()).collect()
}

fn replayed(scratch: &Scratch, session: &str, args: &[&str]) -> Value {
    let words = [&["replay", session, "--verify", "--json"], args].concat();
    let (replay, mut stdout) = scratch.frhc_and_stdout(&words);
    let mut text = String::new();
    stdout.read_to_string(&mut text).unwrap();
    replay.wait().succeeds();
    serde_json::from_str(&text).unwrap()
}

/// Returns the only session in a folder.
fn session_in(folder: &str) -> PathBuf {
    fs::read_dir(folder).unwrap().next().unwrap().unwrap().path()
}

#[test]
fn replay_sends_what_candump_saw_beside_the_run() {
    let scratch = Scratch::new("replay");
    let mut candump = Candump::of("vcan0");
    let sim = scratch.frhc(&["sim", "--config", CONFIG, "--scenario", "contact_10s"]);
    let recording = scratch.path("sessions");
    let run = scratch.frhc(&["run", "--config", CONFIG, "--record", &recording, "--anonymise"]);
    scratch.ctl("--wait arm").succeeds();
    let armed = candump.mark().nanos;
    // Contact, another mode, and a request that is refused because the deadman is closed.
    candump.until(|line| line.nanos > armed + seconds(6.0));
    for (request, code) in [("mode pose", 0), ("disarm", 0), ("arm", 1)] {
        assert_eq!(scratch.ctl(request).code, Some(code), "{request}");
        let now = candump.last_nanos();
        candump.until(|line| line.nanos > now + seconds(0.3));
    }
    run.terminate().succeeds();
    sim.terminate().succeeds();
    let seen = candump.finish();

    let session = session_in(&recording);
    // What was on the wire is not what it is computed from.
    fs::rename(session.join("bus.log"), scratch.path("bus.log")).unwrap();
    let (session, sent) = (session.to_str().unwrap().to_owned(), scratch.path("sent.log"));
    let result = replayed(&scratch, &session, &["--emit", &sent]);
    assert!(result["cycle_count"].as_u64().unwrap() > 6_500, "{result}");
    assert_eq!(result["intermediate"], Value::Null, "{result}");
    let sent = fs::read_to_string(sent).unwrap();
    let (sent, seen) = (of_master(sent.lines()), of_master(seen.iter().map(String::as_str)));
    assert_eq!(sent.len(), seen.len());
    assert!(sent == seen, "first other frame: {:?}", sent.iter().zip(&seen).find(|(a, b)| a != b));
    let description = fs::read_to_string(format!("{session}/session.json")).unwrap();
    assert!(description.contains("\"name\": null"), "{description}");
}

#[test]
fn killed_run_leaves_a_session_that_is_replayed_until_there() {
    let scratch = Scratch::new("replay-killed");
    let mut candump = Candump::of("vcan0");
    let sim = scratch.frhc(&["sim", "--config", CONFIG, "--scenario", "contact_10s"]);
    let recording = scratch.path("sessions");
    let run = scratch.frhc(&["run", "--config", CONFIG, "--record", &recording]);
    scratch.ctl("--wait arm").succeeds();
    let armed = candump.mark().nanos;
    candump.until(|line| line.nanos > armed + seconds(2.0));
    run.kill();
    sim.terminate().succeeds();
    candump.finish();
    let session = session_in(&recording);
    let (replay, mut stdout) =
        scratch.frhc_and_stdout(&["replay", session.to_str().unwrap(), "--json"]);
    let mut text = String::new();
    stdout.read_to_string(&mut text).unwrap();
    replay.wait().succeeds();
    let result: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&result["is_equal"], &result["intermediate"]), (&true.into(), &Value::Null));
    assert!(result["cycle_count"].as_u64().unwrap() > 1_500, "{result}");
}
