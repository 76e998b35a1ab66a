//! Signals that end a run: within a second, with every drive off, though its output is full.

use std::io::Write;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;

use crate::common::log::{Log, NODES};
use crate::common::prelude::*;
use crate::common::rig::seconds;
use nix::sys::signal::Signal;

use canopen::drive::Statusword;
use canopen_tools::candump::Line;

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
pub(crate) fn carried(scratch: &Scratch, stderr: impl Into<Stdio>) -> (Candump, Process, Process) {
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
    let run = scratch.frhc_onto(&["run", "--config", KRAFT], stderr);
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
        let read = Command::new(crate::common::program()).args(read.split(' ')).output();
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
    let sim = scratch.frhc(&[&["sim", "--config", KRAFT][..], &slow].concat());
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
    let run = scratch.frhc(&["run", "--config", KRAFT]);
    let asked = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x606)).nanos;
    run.terminate().succeeds();
    Process::start("cansend", &["vcan0", "7FE#"]).wait().succeeds();
    let gone = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == NOW)).nanos;
    assert!(gone - asked < seconds(1.0), "{} ns", gone - asked);
    sim.terminate().succeeds();
    let log = candump.finish();
    assert!(!log.iter().any(|line| line.contains(" 000#01") || line.contains(" 201#")));
}
