//! Offsets and torque limits that a drive has held since before its boot: 60B0h to 60B2h, 60E0h, 60E1h.

use crate::common::prelude::*;
use canopen_device::station::Station;

/// Arms immediately; closes the deadman 0.4 s after the first SYNC, when the drives are enabled.
const SCRIPT: &str = "seconds = 5\n\
    [[console]]\nat_s = 0.02\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.4\ndeadman = true\n";

/// Returns the reason why the boot of an arm with these quirks in its elbow fails; empty if it does not.
fn boot_refusal(file: &str, quirks: &[&str]) -> String {
    let (mut bench, _) = bench_of(&config(file), SCRIPT, quirks);
    let booted = bench.bring_up();
    for drive in bench.world_mut().drives() {
        assert!(booted.is_ok() || drive.state() != State::OperationEnabled, "{file}: {quirks:?}");
    }
    booted.err().map_or(String::new(), |error| error.to_string())
}

/// Writes an INTEGER16 object of the elbow's drive; the node receives neither the request nor the response.
fn write_unseen(bench: &mut Bench<Wire>, object: Object, value: i16) {
    let now = bench.node().bus().now();
    let ([low, high], [a, b]) = (object.index.to_le_bytes(), value.to_le_bytes());
    let request = Frame::new(0x603, [0x2B, low, high, object.sub, a, b, 0, 0]);
    let drive = bench.world_mut().drive_mut(ELBOW).unwrap();
    drive.on_frame(now, Channel(0), &request, &mut Vec::new());
}

#[test]
fn promise_09_stored_torque_offset_pushes_nothing() {
    for file in HAND_CONTROLLERS {
        let config = config(file);
        if config.joints[ELBOW.index()].eds.object(Object::TORQUE_OFFSET).is_none() {
            continue;
        }
        let (mut bench, wire) = bench_of(&config, "seconds = 5\n", &["stored:60B2h=100"]);
        let (mut without, _) = bench_of(&config, "seconds = 5\n", &[]);
        for bench in [&mut bench, &mut without] {
            bench.bring_up().unwrap_or_else(|error| panic!("{file}: {error}"));
        }
        for _ in 0..100 {
            let (record, other) = (bench.cycle(), without.cycle());
            assert_eq!((record.mode, record.cause), (Mode::Ready, None), "{file}");
            assert_eq!(record.output.q, other.output.q, "{file}: as without an offset");
            let drive = bench.world_mut().drive_mut(ELBOW).unwrap();
            assert_eq!((drive.state(), drive.demand()), (State::OperationEnabled, 0.0), "{file}");
        }
        let enabled = wire.since(Instant::ZERO, 0x80)[0].0;
        let samples = wire.since(enabled, 0x183);
        let pushed =
            samples.iter().find(|(_, it)| it.data().len() == 8 && it.data()[6..] != [0; 2]);
        assert_eq!(pushed, None, "{file}: torque actual, proof test included");
    }
}

#[test]
fn promise_09_offsets_are_cleared_where_the_eds_lacks_them() {
    let config = config("config/drives/technosoft_ipos.toml");
    let (_, plan) = &config.node_plans()[ELBOW.index()];
    for object in [Object::POSITION_OFFSET, Object::VELOCITY_OFFSET, Object::TORQUE_OFFSET] {
        assert!(config.joints[ELBOW.index()].eds.object(object).is_none(), "{object}");
        assert!(plan.writes().iter().any(|(of, _)| *of == object), "{object}: a sheet may omit it");
        assert!(plan.demands().all(|of| of != object), "{object}: a drive may lack it");
    }
}

#[test]
fn drive_that_keeps_an_offset_is_refused() {
    let text = boot_refusal(KRAFT, &["stored:60B2h=100", "forgetful:60B2h"]);
    let reason = "joint 3 (elbow), node 3: 60B2h is 0064h, expected 0000h: an offset acts from enabling on; clear it \
        with the maker's tool";
    assert_eq!(text, reason);
    assert_eq!(boot_refusal(KRAFT, &["forgetful:60B2h"]), "", "it is zero");
}

#[test]
fn torque_limits_below_the_capacity_are_refused() {
    for (object, name) in [("60E0h", "positive torque limit"), ("60E1h", "negative torque limit")] {
        let file = KRAFT;
        let text = boot_refusal(file, &[&format!("stored:{object}=867")]);
        let reason = format!(
            "joint 3 (elbow), node 3: {name} ({object}) is 867 ‰, expected at least 868 ‰: raise it with the maker's \
             tool, or lower max_torque_nm (max_force_n of a sliding joint)"
        );
        assert_eq!(text, reason);
        assert_eq!(boot_refusal(file, &[&format!("stored:{object}=868")]), "");
    }
    let (mut bench, wire) = bench_of(&config(KRAFT), SCRIPT, &[]);
    bench.bring_up().unwrap();
    let limits = [[0xE0, 0x60], [0xE1, 0x60]];
    let is_write = |frame: &Frame| {
        frame.data()[0] != 0x40 && limits.iter().any(|it| frame.data()[1..3] == *it)
    };
    assert!(
        !wire.since(Instant::ZERO, 0x603).iter().any(|(_, frame)| is_write(frame)),
        "read only"
    );
}

#[test]
fn offset_written_while_running_is_found_and_stops_the_node() {
    let (mut bench, _) = bench_of(&config(KRAFT_500HZ), SCRIPT, &[]);
    bench.bring_up().unwrap();
    // Beyond what the torque watch allows it would be seen earlier.
    write_unseen(&mut bench, Object::TORQUE_OFFSET, 3);
    let record = until(&mut bench, |record| record.mode.is_stopped());
    let (node, object) = (ELBOW.into(), Object::TORQUE_OFFSET);
    let cause = Cause::SettingChanged { node, object, expected: 0, found: 3 };
    assert_eq!((record.cause, record.mode), (Some(cause), Mode::DrivesOff));
}

#[test]
fn mapped_torque_offset_receives_nothing_after_the_boot() {
    let mapped = [
        "stored:1401h:1=0x303",
        "stored:1401h:2=255",
        "stored:1601h=1",
        "stored:1601h:1=0x60B20010",
    ];
    let (mut bench, _) = bench_of(&config(KRAFT_500HZ), SCRIPT, &mapped);
    let stray = Frame::new(0x303, [100, 0]);
    let offset = |bench: &mut Bench<Wire>| {
        let now = bench.node().bus().now();
        let drive = bench.world_mut().drive_mut(ELBOW).unwrap();
        drive.on_frame(now, Channel(0), &stray, &mut Vec::new());
        drive.dictionary().i16(Object::TORQUE_OFFSET)
    };
    bench.bring_up().unwrap();
    assert_eq!(offset(&mut bench), 0, "its PDO is switched off");
}

#[test]
fn fixed_mapping_with_a_torque_offset_is_refused() {
    let entries = [0x6040_0010_u32, 0x6071_0010, 0x60B2_0010];
    let mut quirks = vec!["fixed-mapping".to_owned(), "stored:1600h=3".to_owned()];
    quirks.extend((1..).zip(entries).map(|(sub, entry)| format!("stored:1600h:{sub}={entry:#x}")));
    for (sub, entry) in [(1, 0x6041_0010_u32), (2, 0x6064_0020), (3, 0x6077_0010)] {
        quirks.extend([format!("stored:1A00h:{sub}={entry:#x}")]);
    }
    quirks.push("stored:1A00h=3".to_owned());
    let quirks: Vec<&str> = quirks.iter().map(String::as_str).collect();
    let text = boot_refusal(KRAFT_500HZ, &quirks);
    assert!(
        text.contains("1600h is 03h, expected 02h: choose a layout that the device has"),
        "{text}"
    );
}
