//! Drives that display their mode only when enabled (`joint.boot.mode_shown`): each is enabled alone, under 5 % of its
//! torque, and disabled within 10 ms unless it displays torque mode.
#![allow(clippy::wildcard_enum_match_arm, reason = "values of other types are of no interest here")]

use crate::common::prelude::*;
use canopen::drive::Statusword;

/// Both edges of the interval are measured with the resolution of a cycle.
const LOOK_TIME: Duration = Duration::from_millis(10);

/// Returns `text` with `mode_shown = "enabled"` in each joint.
fn shown_when_enabled(text: &str) -> String {
    const KEY: &str = "[joint.boot]\nmode_shown = \"enabled\"\n";
    let mut parts = text.split("[[joint]]\n");
    let mut changed = parts.next().unwrap().to_owned();
    for joint in parts {
        changed.push_str("[[joint]]\n");
        if joint.contains("[joint.boot]\n") {
            changed.push_str(&joint.replace("[joint.boot]\n", KEY));
            continue;
        }
        let starts: Vec<usize> = joint.match_indices("\n[").map(|(at, _)| at + 1).collect();
        let is_of_joint = |at: &usize| {
            joint[*at..].starts_with("[joint.") || joint[*at..].starts_with("[[joint.")
        };
        let end = starts.into_iter().find(|at| !is_of_joint(at)).unwrap_or(joint.len());
        changed.push_str(&format!("{}\n{KEY}\n{}", &joint[..end], &joint[end..]));
    }
    changed
}

/// Returns a bench whose drives have these quirks.
fn bench(config: &Config, quirk: &str, joints: &[Joint]) -> (Bench<Wire>, Wire) {
    let mut scenario = script("seconds = 20\n");
    for joint in joints {
        scenario.quirks_mut().add(*joint, [quirk.parse::<Quirk>().unwrap()]);
    }
    let wire = Wire::default();
    (Bench::new(config, scenario, 1, wire.clone()), wire)
}

/// Returns the times of the elbow's first statusword with `Operation enabled` in a TPDO, and of the "disable voltage"
/// by SDO after it.
fn enabled_and_off(wire: &Wire) -> (Instant, Instant) {
    let is_enabled = |frame: &Frame| {
        let word = frame.data().get(..2).map(|word| u16::from_le_bytes([word[0], word[1]]));
        word.is_some_and(|word| Statusword(word).state() == Some(State::OperationEnabled))
    };
    let tpdos = wire.since(Instant::ZERO, 0x183);
    let enabled = tpdos.iter().find(|(_, frame)| is_enabled(frame)).unwrap().0;
    let requests = wire.since(enabled, 0x603);
    let is_off = |frame: &Frame| frame.data() == [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0];
    (enabled, requests.iter().find(|(_, frame)| is_off(frame)).unwrap().0)
}

/// Values written to an object of the elbow's drive by expedited downloads of two bytes, with their times.
fn written(wire: &Wire, index: u16) -> Vec<(Instant, u16)> {
    let [low, high] = index.to_le_bytes();
    let requests = wire.since(Instant::ZERO, 0x603).into_iter();
    let writes = requests.filter(|(_, frame)| frame.data()[..4] == [0x2B, low, high, 0]);
    writes.map(|(at, frame)| (at, u16::from_le_bytes([frame.data()[4], frame.data()[5]]))).collect()
}

#[test]
fn shipped_files_run_with_drives_that_show_their_mode_late() {
    for file in HAND_CONTROLLERS {
        let config = parse(file, &shown_when_enabled(&text(file)));
        let (mut bench, _) = bench(&config, "mode-when-enabled", &Joint::ALL);
        bench.bring_up().unwrap_or_else(|error| panic!("{file}: {error}"));
        let raised = std::iter::from_fn(|| bench.next_event())
            .filter(|event| matches!(event, Event::LimitsRaised { .. }));
        assert_eq!(raised.count(), 6, "{file}");
        bench.run(20);
        assert_eq!(bench.ask(Request::Arm).unwrap(), Mode::Armed, "{file}");
        for (plan, drive) in config.node_plans().iter().zip(bench.world_mut().drives()) {
            for limit in plan.1.limits_to_raise() {
                let held = drive.dictionary().unsigned(limit.check.object);
                assert_eq!(Some(held), number(&limit.check.expected), "{file}");
            }
        }
    }
}

fn number(value: &canopen::Value) -> Option<u32> {
    match *value {
        canopen::Value::Unsigned16(number) => Some(number.into()),
        canopen::Value::Unsigned32(number) => Some(number),
        canopen::Value::Integer16(number) => u32::try_from(number).ok(),
        canopen::Value::Integer32(number) => u32::try_from(number).ok(),
        _ => None,
    }
}

#[test]
fn drive_in_another_mode_is_disabled_under_5_percent_and_named() {
    for file in HAND_CONTROLLERS {
        let config = parse(file, &shown_when_enabled(&text(file)));
        // Without a mode the drive exerts no torque, and the arm sinks in the hand.
        let mut sunk: Option<f64> = None;
        for mode in [0, 1, 3, 8] {
            let (mut bench, _) = bench(&config, &format!("mode-when-enabled:{mode}"), &[ELBOW]);
            let before = bench.world_mut().plant().q()[2];
            let Err(error) = bench.bring_up() else { panic!("{file}: mode {mode} is accepted") };
            let error = error.to_string();
            // A drive without that mode has none.
            let is_named = [mode, 0].iter().any(|shown| {
                let shown =
                    format!("6061h is {shown} when enabled, although 6060h = 10 was read back");
                error.contains(&shown) && error.ends_with("; the drive is disabled again")
            });
            assert!(error.starts_with("joint 3 (") && is_named, "{file}: {error}");
            let moved = (bench.world_mut().plant().q()[2] - before).abs();
            let sunk = *sunk.get_or_insert(moved);
            assert!(moved < sunk + 0.01, "{file} mode {mode}: {moved} rad, {sunk} without torque");
            for drive in bench.world_mut().drives() {
                assert_ne!(drive.state(), State::OperationEnabled, "{file}");
            }
        }
    }
}

#[test]
fn time_and_torque_limit_hold_on_the_wire() {
    let config = parse(KRAFT_500HZ, &shown_when_enabled(&text(KRAFT_500HZ)));
    let period = config.period;
    for (quirk, is_accepted) in [
        ("mode-when-enabled", true),
        ("mode-when-enabled:8", false),
        ("mode-when-enabled:0", false),
    ] {
        let (mut bench, wire) = bench(&config, quirk, &[ELBOW]);
        assert_eq!(bench.bring_up().is_ok(), is_accepted, "{quirk}");
        let (enabled, off) = enabled_and_off(&wire);
        // It may have been enabled since the SYNC before.
        assert!(off.since(enabled) + period <= LOOK_TIME, "{quirk}: {:?}", off.since(enabled));
        let limits = written(&wire, 0x6072);
        let (while_off, after): (Vec<(Instant, u16)>, Vec<_>) =
            limits.into_iter().partition(|(at, _)| *at < off);
        assert_eq!(while_off.last().unwrap().1, 50, "{quirk}: ‰ of rated torque");
        assert_eq!(!after.is_empty(), is_accepted, "{quirk}");
        assert!(after.iter().all(|(_, limit)| *limit > 50), "{quirk}");
        let modes = written_mode(&wire);
        assert_eq!(modes.last(), Some(&10), "{quirk}");
    }
}

/// Modes written to the elbow's drive.
fn written_mode(wire: &Wire) -> Vec<u8> {
    let requests = wire.since(Instant::ZERO, 0x603).into_iter();
    let writes = requests.filter(|(_, frame)| frame.data()[..4] == [0x2F, 0x60, 0x60, 0]);
    writes.map(|(_, frame)| frame.data()[4]).collect()
}

#[test]
fn drive_that_does_not_answer_is_disabled_in_10_ms() {
    let config = parse(KRAFT_500HZ, &shown_when_enabled(&text(KRAFT_500HZ)));
    let (mut bench, wire) = bench(&config, "slow-sdo:40", &[ELBOW]);
    let Err(error) = bench.bring_up() else { panic!("accepted unseen") };
    let reason = "joint 3 (elbow), node 3: 6061h could not be read within 10 ms of enabling; the drive is disabled again";
    assert_eq!(error.to_string(), reason);
    let (enabled, off) = enabled_and_off(&wire);
    assert!(off.since(enabled) + config.period <= LOOK_TIME, "{:?}", off.since(enabled));
}

#[test]
fn one_drive_is_enabled_at_a_time_until_all_modes_were_seen() {
    let config = parse(KRAFT_500HZ, &shown_when_enabled(&text(KRAFT_500HZ)));
    let (mut bench, wire) = bench(&config, "mode-when-enabled", &Joint::ALL);
    bench.bring_up().unwrap();
    let is_raise = |data: &[u8]| {
        data.len() == 8 && data[..4] == [0x2B, 0x72, 0x60, 0] && data[4..6] != [50, 0]
    };
    let mut enabled = [false; 6];
    let mut seen = [false; 6];
    for (_, telegram) in wire.all() {
        let (cob_id, data) = (telegram.frame.cob_id, telegram.frame.data());
        if (0x601..=0x606).contains(&cob_id) && is_raise(data) && seen == [true; 6] {
            break;
        }
        if let Some(place) = (0x181..=0x186).position(|id| id == cob_id) {
            let word = Statusword(u16::from_le_bytes([data[0], data[1]]));
            enabled[place] = word.state() == Some(State::OperationEnabled);
            seen[place] |= enabled[place];
            assert!(enabled.iter().filter(|is_on| **is_on).count() <= 1, "{enabled:?}");
        }
    }
    assert_eq!(seen, [true; 6]);
}

#[test]
fn planned_rpdos_hold_controlword_and_torque_alone() {
    for file in HAND_CONTROLLERS {
        let config = parse(file, &shown_when_enabled(&text(file)));
        for (_, plan) in config.node_plans() {
            let received = plan.pdos.iter().filter(|pdo| pdo.service.is_some());
            let mapped: Vec<u32> = received
                .flat_map(canopen::layout::Pdo::writes)
                .filter(|(object, _)| (0x1600..0x1604).contains(&object.index) && object.sub > 0)
                .filter_map(|(_, value)| number(&value))
                .map(|entry| entry >> 16)
                .collect();
            // 0005h and 0006h are fillers of groups.
            let is_known = |index: &u32| matches!(index, 0x6040 | 0x6071 | 0x0003..=0x0007);
            assert!(mapped.iter().all(is_known), "{file}: {mapped:X?}");
        }
    }
}

#[test]
fn key_is_refused_where_looking_would_be_dangerous() {
    let of = |file: &str, change: &dyn Fn(String) -> String| {
        let text = change(shown_when_enabled(&text(file)));
        refusal(file, &text)
    };
    let stated = of("config/drives/maxon_epos4.toml", &|text| {
        let limit = text.split("[joint.torque_limit]\n").nth(1).unwrap();
        let limit = limit.split('[').next().unwrap().to_owned();
        text.replace(&limit, "makers_tool_ma = 3000\n\n")
    });
    assert!(stated.contains("mode_shown") && stated.contains("reduce to 5 %"), "{stated}");
    for object in ["607Ah", "60FFh"] {
        let moves = of(KRAFT_500HZ, &|text| {
            let key = "mode_shown = \"enabled\"\n";
            text.replacen(
                key,
                &format!("{key}[[joint.boot.write]]\nobject = \"{object}\"\nvalue = 0\n"),
                1,
            )
        });
        assert!(
            moves.contains(&format!("{object} moves a drive that is not in torque mode")),
            "{moves}"
        );
    }
    let unknown = of(KRAFT_500HZ, &|text| text.replacen("\"enabled\"", "\"later\"", 1));
    assert!(unknown.contains("mode_shown") && unknown.contains("\"always\""), "{unknown}");
    let slow =
        of(KRAFT_500HZ, &|text| text.replace("sync_period_us = 2000", "sync_period_us = 8000"));
    assert!(slow.contains("mode_shown"), "{slow}");
}
