//! Readers of the telemetry of `frhc run`: data and permissions, and no effect on the bus.

use std::io::{BufRead, BufReader};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::net::UnixStream;
use std::thread;

use nix::sys::signal::Signal;

use crate::common::prelude::*;
use crate::common::rig::seconds;
use canopen_tools::candump::Line;

/// A group and a user without any rights.
const GROUP: u32 = 4_242;
const USER: u32 = 65_534;

/// Readers, and how many of them stop reading.
const READERS: usize = 20;
const STOPPED: usize = 5;

/// A frame: time, identifier, target torques in ‰.
type TargetFrame = (u64, u16, Vec<i16>);

/// Bounds of the difference of two runs: of a target and of its mean in ‰, of a time in ns. The hand is simulated by another process, so both
/// depend on how the two are scheduled: runs without readers differ by 6 ‰ and 7 µs in some frames, and by 0.00 ‰ in the mean.
const TARGET: i16 = 20;
const MEAN: f64 = 0.5;
const SHIFT_NS: u64 = 40_000;

fn telemetry(scratch: &Scratch) -> String {
    scratch.path("frhc-view/telemetry.sock")
}

fn is_sync(line: &Line<'_>) -> bool {
    line.canopen().is_some_and(|(id, _)| id == 0x80)
}

/// Connects to a socket as another user with these groups; prints the received data.
fn connecting_as(user: u32, group: u32, socket: &str) -> String {
    let script = "import os, socket, sys\n\
        os.setgroups([]); os.setgid(int(sys.argv[2])); os.setuid(int(sys.argv[3]))\n\
        reader = socket.socket(socket.AF_UNIX)\n\
        try: reader.connect(sys.argv[1])\n\
        except OSError as error: sys.exit(error.strerror)\n\
        sys.exit(reader.recv(32)[:24].decode())\n";
    let (group, user) = (group.to_string(), user.to_string());
    let args = ["-c", script, socket, &group, &user];
    Process::start("python3", &args).wait().stderr.trim().to_owned()
}

#[test]
fn hazard_37_who_may_look_cannot_arm() {
    let scratch = Scratch::new("looking");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT]);
    let run = scratch.frhc(&["run", "--config", KRAFT]);
    candump.until(is_sync);
    let (socket, console) = (telemetry(&scratch), scratch.path("frhc/node.sock"));
    for (path, folder) in [(&socket, "frhc-view"), (&console, "frhc")] {
        assert_eq!(fs::metadata(path).unwrap().permissions().mode() & 0o777, 0o660, "{path}");
        // Everybody may get as far as the socket: its rights alone decide.
        fs::set_permissions(scratch.path(folder), PermissionsExt::from_mode(0o755)).unwrap();
    }
    fs::set_permissions(scratch.path(""), PermissionsExt::from_mode(0o755)).unwrap();
    chown(&socket, None, Some(GROUP)).unwrap();
    let refused = "Permission denied";
    assert_eq!(connecting_as(USER, GROUP, &socket), "{\"version\":1,\"kind\":\"des");
    assert_eq!(connecting_as(USER, GROUP, &console), refused);
    assert_eq!(connecting_as(USER, GROUP + 1, &socket), refused);
    run.terminate().succeeds();
    sim.terminate().succeeds();
}

/// Plays contact for some seconds with this many readers; returns the frames of the node with their times since the first of them, and the
/// lines that one of the readers got.
fn played(name: &str, readers: usize, stopped: usize) -> (Vec<TargetFrame>, Vec<Value>) {
    let scratch = Scratch::new(name);
    let mut candump = Candump::start("vcan0");
    // Twenty interpreters that start must not keep the drives waiting.
    let words = ["sim", "--config", KRAFT, "--scenario", "contact_10s", "--fifo", "70"];
    let sim = scratch.frhc(&words);
    let run = scratch.frhc(&["run", "--config", KRAFT]);
    let first = candump.until(is_sync).nanos;
    let script = "import socket, sys\n\
        reader = socket.socket(socket.AF_UNIX)\n\
        reader.connect(sys.argv[1])\n\
        while reader.recv(65536): pass\n";
    let looking: Vec<_> = (0..readers)
        .map(|_| Process::start("python3", &["-c", script, &telemetry(&scratch)]))
        .collect();
    let own = (readers > 0).then(|| UnixStream::connect(telemetry(&scratch)).unwrap());
    // At once: who does not read is dropped.
    let own = thread::spawn(|| own.map(|own| BufReader::new(own).lines().collect()));
    scratch.ctl("--wait arm").succeeds();
    candump.until(|line| line.nanos > first + seconds(2.0));
    looking.iter().take(stopped).for_each(|reader| reader.signal(Signal::SIGSTOP));
    candump.until(|line| line.nanos > first + seconds(6.0));
    run.terminate().succeeds();
    sim.terminate().succeeds();
    let seen = candump.finish();
    // Of the cycles in contact, from a SYNC by its number: SYNC and the torques.
    let frames = seen.iter().filter_map(|line| -> Option<TargetFrame> {
        let parsed = Line::parse(line).unwrap();
        let (id, data) = parsed.canopen()?;
        let targets = data.chunks_exact(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]]));
        matches!(id, 0x80 | 0x201 | 0x204).then(|| (parsed.nanos, id, targets.collect()))
    });
    let syncs = frames.scan(0, |syncs, (at, id, targets)| {
        *syncs += usize::from(id == 0x80);
        Some((*syncs, at, id, targets))
    });
    let frames: Vec<_> = syncs.filter(|(sync, ..)| (4_000..5_500).contains(sync)).collect();
    let zero = frames[0].1;
    let frames = frames.into_iter().map(|(_, at, id, targets)| (at - zero, id, targets));
    let lines: Option<Vec<_>> = own.join().unwrap();
    let lines = lines.into_iter().flatten();
    let lines = lines.map(|line| serde_json::from_str(&line.unwrap()).unwrap());
    (frames.collect(), lines.collect())
}

#[test]
fn readers_change_nothing_on_the_bus_even_stopped_ones() {
    let (alone, none) = played("alone", 0, 0);
    assert!(alone.len() > 4_000 && none.is_empty(), "{}", alone.len());
    let (watched, lines) = played("watched", READERS, STOPPED);
    assert_eq!(alone.len(), watched.len());
    let pairs = || alone.iter().zip(&watched);
    let differs =
        |((at, id, targets), (other_at, other_id, others)): &(&TargetFrame, &TargetFrame)| {
            let are_near =
                targets.iter().zip(others).all(|(one, other)| (one - other).abs() <= TARGET);
            id != other_id
                || at.abs_diff(*other_at) > SHIFT_NS
                || targets.len() != others.len()
                || !are_near
        };
    assert_eq!(pairs().find(differs), None);
    for (id, place) in [0x201, 0x204].into_iter().flat_map(|id| (0..3).map(move |at| (id, at))) {
        let of_joint = pairs().filter(|((_, sent, _), _)| *sent == id);
        let (mut count, mut sum) = (0.0, 0.0);
        for ((.., targets), (.., others)) in of_joint {
            count += 1.0;
            sum += f64::from(targets[place]) - f64::from(others[place]);
        }
        assert!((sum / count).abs() <= MEAN, "{id:03X}h, target {place}");
    }
    let of = |kind: &'static str| lines.iter().filter(move |line| line["kind"] == kind);
    assert_eq!(lines[0]["kind"], "description");
    assert_eq!(of("description").count(), 1);
    let cycles: Vec<_> = of("snapshot").map(|line| line["cycle"].as_u64().unwrap()).collect();
    assert!(cycles.len() > 250, "{}", cycles.len());
    assert!(cycles.windows(2).all(|pair| pair[1] - pair[0] == 20), "{cycles:?}");
    assert!(of("snapshot").any(|line| line["mode"] == "engaged"));
    assert!(of("mode").count() >= 10);
}
