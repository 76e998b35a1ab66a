//! Sessions of `frhc run`, replayed, and candump beside the run as the judge of what the node has sent.

use std::io::Read;

use serde_json::json;

use crate::common::prelude::*;
use crate::common::rig::seconds;
use canopen_tools::candump::Line;

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
    let text = printed(scratch, &[&["replay", session, "--verify", "--json"], args].concat());
    serde_json::from_str(&text).unwrap()
}

/// Returns the only session in a folder.
fn session_in(folder: &str) -> PathBuf {
    fs::read_dir(folder).unwrap().next().unwrap().unwrap().path()
}

#[test]
fn replay_sends_what_candump_saw_beside_the_run() {
    let scratch = Scratch::new("replay");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let recording = scratch.path("sessions");
    let run = scratch.frhc(&["run", "--config", KRAFT, "--record", &recording, "--anonymise"]);
    scratch.ctl("--wait arm").succeeds();
    let armed = candump.mark().nanos;
    // Contact, adjustments, another mode, and requests that are refused: out of bounds, or because the deadman is closed.
    candump.until(|line| line.nanos > armed + seconds(6.0));
    let requests = [
        ("scale motion 0.5", 0),
        ("scale force 0.25", 0),
        ("scale rotation 1.5", 1),
        ("lock rz on", 0),
        ("align", 1),
        ("mode pose", 0),
        ("disarm", 0),
        ("arm", 1),
    ];
    for (request, code) in requests {
        assert_eq!(scratch.ctl(request).code, Some(code), "{request}");
        let now = candump.last_nanos();
        candump.until(|line| line.nanos > now + seconds(0.3));
    }
    let status = printed(&scratch, &["ctl", "status", "--json"]);
    let status: Value = serde_json::from_str(&status).unwrap();
    assert_eq!(status["status"]["scale"], json!({ "motion": 0.5, "rotation": 1.0, "force": 0.25 }));
    assert_eq!(status["status"]["locked"], json!(["rz"]));
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
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let recording = scratch.path("sessions");
    let run = scratch.frhc(&["run", "--config", KRAFT, "--record", &recording]);
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

/// Records `contact_10s` with these options for some seconds; ends the run by `end`. Returns the session and what was said.
fn recorded(
    scratch: &Scratch,
    options: &[&str],
    length: f64,
    end: impl FnOnce(&Scratch, &Path, Process) -> String,
) -> (String, String) {
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let recording = scratch.path("sessions");
    let run = ["run", "--config", KRAFT, "--record", &recording];
    let run = scratch.frhc(&[&run[..], options].concat());
    scratch.ctl("--wait arm").succeeds();
    let armed = candump.mark().nanos;
    candump.until(|line| line.nanos > armed + seconds(length));
    let session = session_in(&recording);
    let said = end(scratch, &session, run);
    sim.terminate().succeeds();
    candump.finish();
    (session.to_str().unwrap().to_owned(), said)
}

/// Returns the output of a command.
fn printed(scratch: &Scratch, args: &[&str]) -> String {
    let (process, mut stdout) = scratch.frhc_and_stdout(args);
    let mut text = String::new();
    stdout.read_to_string(&mut text).unwrap();
    process.wait().succeeds();
    text
}

/// Returns the number of files of a session with this end of their names.
fn count(session: &str, end: &str) -> usize {
    let names = fs::read_dir(session).unwrap().map(|entry| entry.unwrap().file_name());
    names.filter(|name| name.to_str().unwrap().ends_with(end)).count()
}

#[test]
fn parts_are_packed_during_the_run_and_replayed() {
    let scratch = Scratch::new("replay-parts");
    let (session, said) =
        recorded(&scratch, &["--part-size", "0.2"], 4.0, |scratch, session, run| {
            let session = session.to_str().unwrap();
            let packed = printed(scratch, &["sessions", "pack", session]);
            assert!(packed.contains("; 2 files not finished"), "{packed}");
            let status = printed(scratch, &["ctl", "--json", "status"]);
            let status: Value = serde_json::from_str(&status).unwrap();
            assert!(status["status"]["recording"]["parts"].as_u64().unwrap() > 10, "{status}");
            assert_eq!(status["status"]["recording"]["ended_early"], Value::Null);
            let outcome = run.terminate();
            outcome.succeeds();
            outcome.stderr
        });
    assert!(!said.contains("recording         "), "{said}");
    let parts = count(&session, ".log") + count(&session, ".log.gz");
    assert!(parts > 10 && count(&session, ".log.gz") >= parts - 4, "{parts}");
    let summary = fs::read_to_string(format!("{session}/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["recording"]["parts"].as_u64().unwrap(), u64::try_from(parts).unwrap());
    let result = replayed(&scratch, &session, &[]);
    assert_eq!(result["intermediate"], Value::Null);
    printed(&scratch, &["sessions", "pack", &session]);
    assert_eq!((count(&session, ".log"), count(&session, ".log.gz")), (0, parts));
    assert_eq!(replayed(&scratch, &session, &[]), result);

    // Every cycle is in a class of each histogram that has it.
    let timing = fs::read_to_string(format!("{session}/timing.json")).unwrap();
    let timing: Value = serde_json::from_str(&timing).unwrap();
    for name in ["wake_up_late_us", "step_us", "sync_to_last_target_us"] {
        let classes = timing[name].as_array().unwrap();
        let sum: u64 = classes.iter().map(|class| class["count"].as_u64().unwrap()).sum();
        assert_eq!(sum, summary["timing"][name]["count"].as_u64().unwrap(), "{name}");
    }
}

#[test]
fn hazard_32_run_killed_between_parts_leaves_a_session() {
    // A part has the frames of 15 ms: a kill is never far from a change.
    for length in [1.0, 1.007, 1.013] {
        let scratch = Scratch::new("replay-killed-parts");
        let (session, _) = recorded(&scratch, &["--part-size", "0.01"], length, |_, _, run| {
            run.kill();
            String::new()
        });
        assert!(count(&session, ".log") > 50);
        let text = printed(&scratch, &["replay", &session, "--json"]);
        let result: Value = serde_json::from_str(&text).unwrap();
        assert_eq!((&result["is_equal"], &result["intermediate"]), (&true.into(), &Value::Null));
        assert!(result["cycle_count"].as_u64().unwrap() > 900, "{result}");
        assert!(!result["end"].as_str().unwrap().contains("is missing"), "{result}");
        let list = printed(&scratch, &["sessions", "list", &session]);
        assert!(list.contains("no summary") && !list.contains("missing"), "{list}");
    }
}

#[test]
fn hazard_32_limit_of_a_recording_leaves_the_run() {
    let scratch = Scratch::new("replay-limit");
    let options = ["--part-size", "0.2", "--record-limit", "0.001"];
    let (session, said) = recorded(&scratch, &options, 4.0, |scratch, _, run| {
        let status = printed(scratch, &["ctl", "--json", "status"]);
        let status: Value = serde_json::from_str(&status).unwrap();
        let reason = status["status"]["recording"]["ended_early"].as_str().unwrap();
        assert!(reason.contains("its limit of 0.001 GB is reached"), "{status}");
        let outcome = run.terminate();
        outcome.succeeds();
        outcome.stderr
    });
    assert_eq!(said.matches("the recording has ended, and the run goes on").count(), 1, "{said}");
    assert!(said.contains("parts; ended early: its limit of 0.001 GB"), "{said}");
    let result = replayed(&scratch, &session, &[]);
    assert!(result["cycle_count"].as_u64().unwrap() > 500, "{result}");
    let size: u64 = fs::read_dir(&session)
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| {
            [Some("log"), Some("bin")]
                .contains(&entry.path().extension().and_then(|it| it.to_str()))
        })
        .map(|entry| entry.metadata().unwrap().len())
        .sum();
    assert!((1_000_000..1_020_000).contains(&size), "{size}");
}
