//! Recordings of a run: on a disk that is full or hangs, in the state folder, beside another one.

use crate::common::log::{Log, NODES};
use crate::common::prelude::*;
use crate::ends::carried;
use nix::sys::signal::Signal;

use canopen_tools::candump::Line;

#[test]
fn hazard_32_limit_of_file_size_ends_the_recording_alone() {
    let scratch = Scratch::new("file-size");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let session = scratch.path("session");
    let run =
        scratch.frhc_under("ulimit -f 500", &["run", "--config", KRAFT, "--record", &session]);
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

/// A file system in memory, of a few MB.
struct SmallDisk {
    path: String,
}

impl SmallDisk {
    fn in_folder(scratch: &Scratch, size: &str) -> Self {
        let path = scratch.path("small-disk");
        let mount = "mkdir $0 && mount -t tmpfs -o size=$1 tmpfs $0";
        Process::start("sh", &["-c", mount, &path, size]).wait().succeeds();
        Self { path }
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        Process::start("umount", &["-l", &self.path]).wait();
    }
}

#[test]
fn hazard_32_disk_that_hangs_delays_the_end_by_a_second() {
    let scratch = Scratch::new("hung-disk");
    let mut disk = Disk::in_folder(&scratch);
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let session = format!("{}/session", disk.path);
    let stderr = scratch.path("stderr");
    let words = ["run", "--config", KRAFT, "--record", &session];
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
    let is_off =
        |entry: &&crate::common::log::Entry| entry.id == 0 && entry.data.first() == Some(&0x80);
    let off = log.entries().iter().find(|entry| is_off(entry) && entry.nanos > signalled);
    let off = Duration::from_nanos(off.unwrap().nanos - signalled);
    assert!(off <= Duration::from_millis(200), "{off:?}");
    log.ends_with_every_drive_off(NODES);
}

#[test]
fn hazard_32_run_killed_on_a_full_disk_leaves_a_session() {
    let scratch = Scratch::new("full-disk");
    let disk = SmallDisk::in_folder(&scratch, "4m");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let recording = format!("{}/sessions", disk.path);
    let stderr = scratch.path("stderr");
    let words = ["run", "--config", KRAFT, "--record", &recording];
    let run = scratch.frhc_onto(&words, fs::File::create(&stderr).unwrap());
    scratch.ctl("--wait arm").succeeds();
    let printed = || fs::read_to_string(&stderr).unwrap();
    let armed = candump.mark().nanos;
    candump.until(|line| {
        assert!(line.nanos < armed + 60_000_000_000, "the disk does not fill: {}", printed());
        // Once in 50 frames or so.
        line.nanos % 1_000_000 < 20_000
            && printed().contains("the recording has stopped: No space left")
    });
    // The run goes on without its recording.
    scratch.ctl("status").succeeds();
    let full = candump.mark().nanos;
    candump.until(|line| line.nanos > full + 500_000_000);
    run.kill();
    let killed = candump.mark().nanos;
    candump.until(|line| line.nanos > killed + 100_000_000);
    sim.terminate().succeeds();
    candump.finish();
    let session = only(&recording);
    let words = ["replay", session.to_str().unwrap(), "--json"];
    let (replay, stdout) = scratch.frhc_and_stdout(&words);
    let result: Value = serde_json::from_reader(stdout).unwrap();
    replay.wait().succeeds();
    assert_eq!(result["is_equal"], Value::from(true), "{result}");
    assert!(result["cycle_count"].as_u64().unwrap() > 1_000, "{result}");
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
    let fault: Value = serde_json::from_str(&fault).unwrap();
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
        let sim = scratch.frhc(&["sim", "--config", KRAFT]);
        let run = scratch.frhc(&["run", "--config", KRAFT, "--record", &parent]);
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
pub(crate) fn only(folder: &str) -> PathBuf {
    let mut entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let entry = entries.next().unwrap();
    assert_eq!(entries.next(), None, "one entry");
    entry
}
