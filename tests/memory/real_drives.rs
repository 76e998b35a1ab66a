//! Rehearsal: the arms of config/drives, whose drives are made from the data sheets of real ones.

use crate::common::prelude::*;
use campaign::monitor::{Answer, Monitor};

/// Arms immediately; closes the deadman 0.4 s after the first SYNC, when the drives are enabled.
const SCRIPT: &str = "seconds = 5\n\
    [[console]]\nat_s = 0.02\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.4\ndeadman = true\n";

/// Every configuration, with the timers that stop its drives.
fn files() -> Vec<(String, Config)> {
    let entries = fs::read_dir("config/drives").unwrap().map(|entry| entry.unwrap().path());
    let name = |path: &Path| path.to_str().unwrap().to_owned();
    entries.map(|path| (name(&path), config(&name(&path)))).collect()
}

#[test]
fn arm_of_each_maker_engages_and_stops_without_a_fault() {
    let files = files();
    assert!(files.len() >= 5, "{}", files.len());
    for (name, config) in files {
        let (mut bench, _) = bench_of(&config, SCRIPT, &[]);
        bench.bring_up().unwrap_or_else(|error| panic!("{name}: {error}"));
        let engaged = (0..500).map(|_| bench.cycle()).find(|it| it.mode == Mode::Engaged);
        assert!(engaged.is_some(), "{name}");
        let stops = (0..200).map(|_| bench.cycle()).find(|it| it.mode != Mode::Engaged);
        assert!(stops.is_none(), "{name}: {:?}", stops.unwrap().cause);
        bench.shut_down().unwrap_or_else(|error| panic!("{name}: {error}"));
        for drive in bench.world_mut().drives() {
            assert_eq!(drive.state(), State::SwitchOnDisabled, "{name}");
        }
    }
}

#[test]
fn every_drive_is_proven_by_the_timers_of_its_maker() {
    for (name, config) in files() {
        let (mut bench, _) = bench_of(&config, SCRIPT, &[]);
        bench.bring_up().unwrap();
        let proven = bench.node().proof_test_report().clone();
        let planned = config.stopping();
        for (drive, planned) in proven.drives.iter().zip(planned) {
            let tripped: Vec<_> = drive.expiries().map(|expiry| expiry.watchdog).collect();
            assert_eq!(tripped, planned.watchdogs, "{name}: {}", drive.name);
        }
        let awaited =
            |expected| proven.drives.iter().all(|drive| drive.guarding.is_some() == expected);
        assert!(awaited(name.contains("ipos")), "{name}: guarding alone stops iPOS");
    }
}

#[test]
fn stored_values_are_found_in_drives_of_elmo() {
    let elmo = config("config/drives/elmo_gold.toml");
    for (quirk, object) in [
        ("polarity-reversed", "607Eh"),
        ("stored:6091h:1=2", "6091h"),
        ("stored:608Fh:1=8192", "608Fh"),
        ("stored:6076h=131000", "6076h"),
    ] {
        let booted = bench_of(&elmo, SCRIPT, &[quirk]).0.bring_up();
        let error = booted.err().map_or(String::new(), |error| error.to_string());
        assert!(error.contains("joint 3 (elbow)") && error.contains(object), "{quirk}: {error}");
    }
}

#[test]
fn simulated_drives_hold_what_the_makers_tool_must_set() {
    let nanotec = config("config/drives/nanotec_cl4e.toml");
    let eds = &nanotec.joints[2].eds;
    let default = eds.object(Object::POSITION_UNIT).unwrap().number.unwrap();
    assert_eq!(
        default.resolve(nanotec.joints[2].node),
        0xFF41_0000,
        "tenths of a degree at delivery"
    );
    let (mut bench, _) = bench_of(&nanotec, SCRIPT, &[]);
    let drive = bench.world_mut().drive_mut(Joint::of::<3>()).unwrap();
    assert_eq!(drive.dictionary().unsigned(Object::POSITION_UNIT), 0x00B5_0000);
    assert_eq!(drive.dictionary().unsigned(Object::VELOCITY_UNIT), 0x00B4_4700);
}

#[test]
fn monitor_finds_no_violation_with_the_drives_of_each_maker() {
    for (name, config) in files() {
        let mut bench = Bench::new(&config, script(SCRIPT), 1, Monitor::new(&config));
        bench.bring_up().unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut has_pushed = false;
        for _ in 0..400 {
            let mode = bench.node().mode();
            let record = bench.cycle();
            let now = bench.node().bus().now();
            if mode == Mode::Ready && record.mode == Mode::Armed {
                bench.tap_mut().on_answer(now, Answer::Armed);
            }
            has_pushed |= record.mode == Mode::Engaged && record.targets.iter().any(|it| *it != 0);
        }
        assert!(has_pushed, "{name}");
        let violations = bench.tap_mut().violations();
        assert!(violations.is_empty(), "{name}: {violations:?}");
    }
}
