//! `frhc export mcap` as a user runs it: complete sessions, and incomplete or changed ones. Other people's
//! programs read the files in `tests/interop/exports.py`.

use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt;
use std::thread;

use mcap::MessageStream;
use mcap::read::Summary;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::common::prelude::*;
use crate::common::program;
use crate::common::sessions::change_copy;

const POSITIONS: &str = "/frhc/measured_js";
const WRENCHES: &str = "/frhc/object/measured_cf";
const TORQUES: &str = "/frhc/torques";

/// Records a session of six seconds with more arguments of `demo`.
fn session(name: &str, args: &[&str]) -> PathBuf {
    let session = folder("exports", name).join("session");
    let out = session.to_str().unwrap();
    let demo = ["-q", "demo", "--scenario", "contact_10s", "--out", out];
    let seconds: &[&str] = if args.contains(&"--seconds") { &[] } else { &["--seconds", "6"] };
    let ended = frhc(&[&demo[..], seconds, args].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    session
}

fn export(session: &Path, args: &[&str]) -> CommandOutput {
    frhc(&[&["export", "mcap", session.to_str().unwrap()], args].concat())
}

/// An exported file.
struct File {
    bytes: Vec<u8>,
    /// Number of messages by topic.
    counts: BTreeMap<String, u64>,
    notes: String,
}

fn exported(session: &Path, args: &[&str]) -> File {
    let file = session.with_extension("mcap");
    let ended = export(session, &[&["-o", file.to_str().unwrap(), "--force"], args].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let bytes = fs::read(&file).unwrap();
    let mut counts = BTreeMap::new();
    for message in MessageStream::new(&bytes).unwrap() {
        *counts.entry(message.unwrap().channel.topic.clone()).or_default() += 1;
    }
    for (topic, count) in &counts {
        let is_printed = |line: &str| {
            let words: Vec<_> = line.split_whitespace().collect();
            words == [topic.as_str(), &format!("{count}")]
        };
        assert!(ended.stdout.lines().any(is_printed), "{topic}: {count}\n{}", ended.stdout);
    }
    File { bytes, counts, notes: ended.stderr }
}

impl File {
    fn count(&self, topic: &str) -> u64 {
        self.counts.get(topic).copied().unwrap_or_default()
    }

    /// Returns a record about the session.
    fn record(&self, name: &str) -> BTreeMap<String, String> {
        let summary = Summary::read(&self.bytes).unwrap().unwrap();
        let index = summary.metadata_indexes.iter().find(|index| index.name == name).unwrap();
        mcap::read::metadata(&self.bytes, index).unwrap().metadata
    }
}

#[test]
fn file_is_private_and_the_same_every_time() {
    let session = session("same", &[]);
    let file = exported(&session, &[]);
    assert_eq!((file.notes.as_str(), file.count(POSITIONS)), ("", 6_000));
    let path = session.with_extension("mcap");
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    let stdout = Command::new(program()).args(["export", "mcap"]).arg(&session).output().unwrap();
    assert!(stdout.status.success() && stdout.stderr.is_empty());
    assert!(stdout.stdout == file.bytes, "stdout has the same bytes");
}

/// A minute at 1 kHz, of which this is a tenth, took 210 MB.
#[test]
fn minute_of_a_session_takes_45_mb_at_most() {
    let session = session("size", &[]);
    let file = exported(&session, &[]);
    assert!(file.bytes.len() < 4_500_000, "{} bytes of 6 s", file.bytes.len());
    let summary = Summary::read(&file.bytes).unwrap().unwrap();
    assert!(summary.chunk_indexes.iter().all(|chunk| chunk.compression == "lz4"));
    for topic in ["/tf", "/frhc/status", TORQUES] {
        // 100 Hz, and changes of mode.
        assert!((600..620).contains(&file.count(topic)), "{topic}: {}", file.count(topic));
    }
    let full = exported(&session, &["--full-rate"]);
    assert_eq!((full.count("/tf"), full.count(TORQUES)), (6_000, 6_000));
}

#[test]
fn part_of_a_session_has_its_cycles_alone() {
    let session = session("part", &[]);
    let file = exported(&session, &["--from", "1000", "--to", "1499", "--ros-only"]);
    assert_eq!((file.count(POSITIONS), file.count("/tf"), file.count(TORQUES)), (500, 50, 0));
    assert_eq!(file.record("frhc.findings")["cycles"], "500");
}

#[test]
fn session_that_replays_otherwise_keeps_what_its_log_has() {
    let session = session("gain", &[]);
    change_copy(&session, "kraft_like.toml", |text| {
        text.replace("wrench_gain = [0.3, 0.3, 0.3", "wrench_gain = [0.4, 0.4, 0.4")
    });
    let file = exported(&session, &["--full-rate"]);
    assert_eq!(
        (file.count(POSITIONS), file.count(WRENCHES), file.count("/tf")),
        (6_000, 6_000, 6_000)
    );
    let replayed = file.count(TORQUES);
    assert!((1_000..6_000).contains(&replayed), "{replayed} cycles are replayed");
    assert_eq!(file.count("/frhc/object/command"), replayed);
    let findings = file.record("frhc.findings");
    assert_eq!(findings["cycles_without_replay"], (6_000 - replayed).to_string());
    assert!(findings["replay"].contains("other frames are sent"), "{findings:?}");
    assert_eq!(file.notes.lines().count(), 1, "{}", file.notes);
    assert!(file.notes.contains(&findings["warning_1"]), "{}", file.notes);
}

#[test]
fn session_without_inputs_or_with_half_a_log_is_exported() {
    let session = session("halves", &[]);
    let log = fs::read(session.join("bus.log")).unwrap();
    fs::write(session.join("bus.log"), &log[..log.len() / 2]).unwrap();
    let file = exported(&session, &["--full-rate"]);
    assert_eq!((file.count(POSITIONS), file.count(TORQUES)), (6_000, 6_000));
    assert!(file.notes.contains("bus.log does not have"), "{}", file.notes);
    fs::write(session.join("bus.log"), &log).unwrap();
    fs::remove_file(session.join("inputs.bin")).unwrap();
    let file = exported(&session, &[]);
    assert_eq!(
        (file.count(POSITIONS), file.count(WRENCHES), file.count(TORQUES)),
        (6_000, 6_000, 0)
    );
    assert!(file.notes.contains("no replay of 6000 cycles"), "{}", file.notes);
    fs::remove_file(session.join("bus.log")).unwrap();
    let refused = export(&session, &["-o", session.with_extension("none").to_str().unwrap()]);
    assert_eq!((refused.code, refused.stdout.as_str()), (4, ""), "{}", refused.stderr);
    assert!(!session.with_extension("none").exists());
}

#[test]
fn joints_of_any_name_are_in_the_file() {
    let folder = folder("exports", "names");
    let eds = fs::canonicalize("eds").unwrap();
    let name = r#"<script>"Ellenbogen" é & 'x'"#;
    let config = fs::read_to_string(KRAFT).unwrap();
    let config = config.replace("../eds", eds.to_str().unwrap());
    let config = config.replace(r#"name = "elbow""#, &format!("name = {name:?}"));
    let path = folder.join("named.toml");
    fs::write(&path, config).unwrap();
    let session = session("named", &["--config", path.to_str().unwrap(), "--seconds", "2"]);
    let file = exported(&session, &[]);
    assert_eq!(file.notes, "");
    let of_joints = |topic: &str| {
        let messages = MessageStream::new(&file.bytes).unwrap().map(Result::unwrap);
        messages.filter(|message| message.channel.topic == topic).last().unwrap().data.into_owned()
    };
    for topic in [POSITIONS, "/diagnostics"] {
        let data = of_joints(topic);
        assert!(data.windows(name.len()).any(|part| part == name.as_bytes()), "{topic}");
    }
    let joints: Vec<String> = serde_json::from_str(&file.record("frhc.session")["joints"]).unwrap();
    assert_eq!(joints[2], name);
}

#[test]
fn export_that_fails_leaves_no_file() {
    let session = session("failed", &[]);
    let folder = folder("exports", "failed-out");
    let is_empty = || fs::read_dir(&folder).unwrap().next().is_none();
    let absent = folder.join("absent/a.mcap");
    let (out, taken) = (folder.join("a.mcap"), folder.join("taken.mcap"));
    for (target, code) in [(&absent, 4), (&folder, 2), (&PathBuf::from("/dev/full"), 4)] {
        let ended = export(&session, &["-o", target.to_str().unwrap()]);
        assert_eq!((ended.code, ended.stdout.as_str()), (code, ""), "{}", ended.stderr);
        assert!(ended.stderr.lines().count() == 1 && is_empty(), "{}", ended.stderr);
    }
    let nothing = folder.join("nothing");
    let not_one = export(&nothing, &["-o", out.to_str().unwrap()]);
    assert!(not_one.code == 4 && is_empty(), "{}", not_one.stderr);
    // A disk that fills: files may have a megabyte.
    let limited = format!(
        "ulimit -f 1024; exec {} export mcap {} -o {}",
        program(),
        session.display(),
        out.display()
    );
    let full = Command::new("bash").args(["-c", &limited]).output().unwrap();
    let stderr = String::from_utf8(full.stderr).unwrap();
    assert!(full.status.code() == Some(4) && is_empty(), "{:?} {stderr}", full.status);
    assert!(stderr.contains("a.mcap: File too large"), "{stderr}");
    fs::write(&taken, "mine").unwrap();
    let refused = export(&session, &["-o", taken.to_str().unwrap()]);
    assert!(refused.code == 2 && refused.stderr.contains("exists"), "{}", refused.stderr);
    assert_eq!(fs::read(&taken).unwrap(), b"mine");
}

#[test]
fn interrupted_export_is_130_and_leaves_no_file() {
    let session = session("interrupted", &["--seconds", "30"]);
    let folder = folder("exports", "interrupted-out");
    let mut command = Command::new(program());
    command.args(["export", "mcap"]).arg(&session).arg("-o").arg(folder.join("a.mcap"));
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    while fs::read_dir(&folder).unwrap().next().is_none() {
        thread::yield_now();
    }
    kill(Pid::from_raw(child.id().try_into().unwrap()), Signal::SIGINT).unwrap();
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(130), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(ended.stdout.is_empty() && fs::read_dir(&folder).unwrap().next().is_none());
}
