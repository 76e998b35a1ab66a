//! Confirmation that drives are off after disable voltage: hazard 46, in both layouts and with heartbeats alone.

use crate::common::prelude::*;
use canopen_rs::NmtState;

use node::cause::CauseKind;

/// One PDO per direction, heartbeat consumer only.
const HEARTBEAT_ONLY: &str = "config/drives/maxon_epos4.toml";
const ALL: [&str; 3] = [KRAFT, KRAFT_500HZ, HEARTBEAT_ONLY];

const FIVE_MS: Duration = Duration::from_millis(5);

/// The elbow's drive does not obey its controlword.
const IGNORED: &str = "[[fault]]\nat_s = 1.5\nkind = \"controlword_ignored\"\njoint = 3\n";
const NO_NMT: &str = "[[fault]]\nat_s = 1.5\nkind = \"drop\"\njoint = 3\nframe = \"nmt\"\n";
/// A stop for another reason, in another drive.
const EMERGENCY: &str = "[[fault]]\nat_s = 1.55\nkind = \"emergency\"\njoint = 5\ncode = 0x4210\n";

fn lost(frame: &str) -> String {
    format!("[[fault]]\nat_s = 1.5\nkind = \"drop\"\njoint = 3\nframe = \"{frame}\"\n")
}

/// Returns an armed node that has just stopped by the emergency of joint 5 while `faults` last.
fn stopped(file: &str, faults: &str) -> (Bench<Wire>, Wire, Record) {
    let wire = Wire::default();
    let mut bench =
        started(&config(file), script(&format!("seconds = 20\n{faults}{EMERGENCY}")), wire.clone());
    bench.run(20);
    bench.ask(Request::Arm).unwrap();
    wire.clear();
    let record = until(&mut bench, |record| record.mode.is_stopped());
    assert_eq!(record.cause.map(|cause| cause.kind()), Some(CauseKind::Emergency), "{file}");
    (bench, wire, record)
}

fn run_for(bench: &mut Bench<Wire>, time: Duration) {
    let until = bench.node().bus().now() + time;
    while bench.node().bus().now() < until {
        bench.cycle();
    }
}

fn states(bench: &mut Bench<Wire>) -> [State; 6] {
    bench.world_mut().drives().each_ref().map(|drive| drive.state())
}

fn is_enabled(bench: &mut Bench<Wire>) -> bool {
    states(bench)[2] == State::OperationEnabled
}

/// Returns the time of the first frame to the elbow that begins with `data`.
fn first(wire: &Wire, cob_id: u16, data: &[u8]) -> Option<Instant> {
    let frames = wire.since(Instant::ZERO, cob_id);
    frames.iter().find(|(_, frame)| frame.data().starts_with(data)).map(|(at, _)| *at)
}

const DOWNLOAD: [u8; 4] = [0x2B, 0x40, 0x60, 0];
const UPLOAD: [u8; 4] = [0x40, 0x41, 0x60, 0];
const NMT_STOP: [u8; 2] = [0x02, 3];
const NMT_PRE_OPERATIONAL: [u8; 2] = [0x80, 3];

/// Returns the newest heartbeat of the master.
fn last_heartbeat(wire: &Wire) -> Instant {
    wire.since(Instant::ZERO, 0x77F).last().unwrap().0
}

#[test]
fn hazard_46_lost_controlword_is_replaced_by_sdo() {
    for (file, frame) in [(KRAFT, "rpdo2"), (HEARTBEAT_ONLY, "rpdo1")] {
        let (mut bench, wire, record) = stopped(file, &lost(frame));
        run_for(&mut bench, Duration::from_millis(160));
        assert!(!is_enabled(&mut bench), "{file}");
        let written = first(&wire, 0x603, &DOWNLOAD).unwrap();
        let read = first(&wire, 0x603, &UPLOAD).unwrap();
        assert!(read.since(written) <= Duration::from_millis(10), "{file}");
        assert!(written.since(record.at) <= Duration::from_millis(130), "{file}");
        let after = bench.cycle();
        assert_eq!((after.mode, after.not_off), (Mode::DrivesOff, [false; 6]), "{file}");
        assert_eq!(first(&wire, 0, &NMT_STOP), None, "{file}");
        assert!(bench.shut_down().is_ok(), "{file}");
    }
}

#[test]
fn hazard_46_drive_ignoring_its_controlword_is_stopped_by_nmt() {
    for file in ALL {
        let (mut bench, wire, _) = stopped(file, IGNORED);
        let named = until(&mut bench, |record| record.not_off[2]);
        assert_eq!(named.not_off.iter().filter(|it| **it).count(), 1, "{file}");
        run_for(&mut bench, Duration::from_millis(60));
        let written = first(&wire, 0x603, &DOWNLOAD).unwrap();
        let halted = first(&wire, 0, &NMT_STOP).unwrap();
        let back = first(&wire, 0, &NMT_PRE_OPERATIONAL).unwrap();
        let waited = halted.since(written);
        // On the wire a frame waits for others.
        assert!(waited >= Duration::from_micros(9_500), "{file}: {waited:?}");
        assert!(waited <= Duration::from_millis(10) + FIVE_MS, "{file}: {waited:?}");
        let paused = back.since(halted);
        assert!(paused >= Duration::from_micros(19_500), "{file}: {paused:?}");
        assert!(paused <= Duration::from_millis(20) + FIVE_MS, "{file}: {paused:?}");
        assert!(!is_enabled(&mut bench), "{file}");
        let record = bench.cycle();
        assert_eq!((record.mode, record.not_off), (Mode::DrivesOff, [false; 6]), "{file}");
        let now = bench.node().bus().now();
        assert!(now.since(last_heartbeat(&wire)) < Duration::from_millis(60), "{file}");
    }
}

#[test]
fn hazard_46_heartbeats_end_when_nothing_else_disables_a_drive() {
    for file in ALL {
        let (mut bench, wire, _) = stopped(file, &format!("{IGNORED}{NO_NMT}"));
        let named = until(&mut bench, |record| record.not_off[2]);
        run_for(&mut bench, Duration::from_millis(400));
        assert!(last_heartbeat(&wire).since(named.at) < Duration::from_millis(60), "{file}");
        assert_eq!(states(&mut bench), [State::Fault; 6], "{file}: by their own watchdogs");
        assert_eq!(bench.node().mode(), Mode::DrivesOff, "{file}");
    }
}

#[test]
fn hazard_46_reset_after_the_last_step_boots_again() {
    let faults = format!("{}for_s = 2.0\n{}for_s = 2.0\n", IGNORED, NO_NMT);
    let (mut bench, wire, _) = stopped(HEARTBEAT_ONLY, &faults);
    run_for(&mut bench, Duration::from_millis(2_500));
    wire.clear();
    assert_eq!(bench.ask(Request::Reset).unwrap(), Mode::Ready);
    assert!(first(&wire, 0x77F, &[5]).is_some(), "heartbeats again");
    assert_eq!(states(&mut bench), [State::OperationEnabled; 6]);
    let elbow = bench.world_mut().drive_mut(ELBOW).unwrap();
    assert_eq!(elbow.nmt_state(), NmtState::Operational);
}

#[test]
fn hazard_46_reset_after_an_nmt_stop_boots_again() {
    let (mut bench, _, _) = stopped(HEARTBEAT_ONLY, &format!("{IGNORED}for_s = 1.0\n"));
    run_for(&mut bench, Duration::from_millis(1_500));
    assert_eq!(bench.ask(Request::Reset).unwrap(), Mode::Ready);
    assert_eq!(states(&mut bench), [State::OperationEnabled; 6]);
}

#[test]
fn hazard_46_failed_reset_keeps_the_name_of_a_drive() {
    for file in ALL {
        let (mut bench, _, _) =
            stopped(file, &format!("{IGNORED}for_s = 2.0\n{NO_NMT}for_s = 2.0\n"));
        run_for(&mut bench, Duration::from_millis(400));
        bench.world_mut().drive_mut(ELBOW).unwrap().unplug();
        let only_elbow = [false, false, true, false, false, false];
        assert_eq!(bench.cycle().not_off, only_elbow, "{file}");
        bench.ask(Request::Reset).unwrap_err();
        let error = bench.clone().shut_down().unwrap_err().to_string();
        assert!(
            error.starts_with("joint 3: drive did not confirm that it is off"),
            "{file}: {error}"
        );
        run_for(&mut bench, Duration::from_millis(2_000));
        let record = bench.cycle();
        assert_eq!((record.mode, record.not_off), (Mode::DrivesOff, only_elbow), "{file}");
        // A boot reads its statusword again.
        bench.world_mut().drive_mut(ELBOW).unwrap().plug();
        assert_eq!(bench.ask(Request::Reset).unwrap(), Mode::Ready, "{file}");
        assert_eq!(bench.cycle().not_off, [false; 6], "{file}");
    }
}

#[test]
fn hazard_46_drive_that_never_answers_is_named_at_the_end() {
    for file in ALL {
        let (mut bench, wire, _) = stopped(file, "");
        bench.world_mut().drive_mut(ELBOW).unwrap().unplug();
        let error = bench.shut_down().unwrap_err().to_string();
        assert!(
            error.starts_with("joint 3: drive did not confirm that it is off"),
            "{file}: {error}"
        );
        assert!(!error.contains("joint 5"), "{file}: {error}");
        assert!(first(&wire, 0, &NMT_STOP).is_some(), "{file}");
        let now = bench.node().bus().now();
        assert!(now.since(last_heartbeat(&wire)) > Duration::from_millis(300), "{file}");
    }
}

#[test]
fn orderly_and_ordinary_stops_confirm_by_statusword_alone() {
    for file in ALL {
        for is_orderly in [true, false] {
            let (mut bench, wire, _) = stopped(file, "");
            if is_orderly {
                bench.shut_down().unwrap();
            } else {
                run_for(&mut bench, Duration::from_millis(200));
            }
            assert_eq!(first(&wire, 0, &[0x02]), None, "{file}");
            for elbow_to_last in 0x601..=0x606 {
                assert_eq!(first(&wire, elbow_to_last, &DOWNLOAD), None, "{file}");
                assert_eq!(first(&wire, elbow_to_last, &UPLOAD), None, "{file}");
            }
        }
    }
}

#[test]
fn drive_without_statusword_tpdo_is_confirmed_by_sdo() {
    // The elbow's statusword is lost after the stop; its drive obeys.
    let silent = "[[fault]]\nat_s = 1.549\nkind = \"drop\"\njoint = 3\nframe = \"tpdo2\"\n";
    let (mut bench, wire, _) = stopped(KRAFT, silent);
    run_for(&mut bench, Duration::from_millis(200));
    let record = bench.cycle();
    assert_eq!((record.mode, record.not_off), (Mode::DrivesOff, [false; 6]));
    assert!(first(&wire, 0x603, &UPLOAD).is_some());
    assert_eq!(first(&wire, 0, &NMT_STOP), None);
    assert_eq!(record.cause.map(|cause| cause.kind()), Some(CauseKind::Emergency));
}

#[test]
fn first_cause_of_a_stop_is_kept_when_a_drive_stays_on() {
    let (mut bench, _, _) = stopped(KRAFT_500HZ, IGNORED);
    let record = until(&mut bench, |record| record.not_off[2]);
    assert!(matches!(record.cause, Some(Cause::Emergency { .. })), "{:?}", record.cause);
    assert_eq!(record.targets, [0; 6]);
}
