//! Drives that no longer receive their RPDOs, on the arms of config/drives: hazard 13.

use crate::common::prelude::*;
use config::SeenBy;

/// Presses into the wall from 3.0 s on, as `config/scenarios/contact_10s.toml` does.
const PRESS: &str = include_str!("../../config/scenarios/contact_10s.toml");

/// Arms immediately, and closes the deadman after 0.4 s.
const HOLD: &str = "seconds = 5\n\
    [[console]]\nat_s = 0.02\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.4\ndeadman = true\n";

/// Every configuration whose drives have no RPDO timer, with its drives' longest time of a held torque.
fn without_timer() -> Vec<(String, Config, Duration)> {
    let entries = fs::read_dir("config/drives").unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.map(|path| path.to_str().unwrap().to_owned()).collect();
    files.sort();
    let mut found = Vec::new();
    for file in files {
        let config = config(&file);
        let held = config.held_torques()[2];
        if held.seen_by != SeenBy::RpdoTimer {
            found.push((file, config, held.time));
        }
    }
    assert_eq!(
        found.len(),
        4,
        "{found:?}",
        found = found.iter().map(|it| &it.0).collect::<Vec<_>>()
    );
    found
}

/// Scenario fault: RPDO1 of a joint is lost from `at_s` on.
fn lost_rpdo(joint: usize, at_s: f64, rest: &str) -> String {
    format!(
        "[[fault]]\nat_s = {at_s}\nkind = \"drop\"\njoint = {joint}\nframe = \"rpdo1\"\n{rest}\n"
    )
}

fn booted(config: &Config, text: &str) -> (Bench<Wire>, Wire, Instant) {
    let wire = Wire::default();
    let bench = started(config, script(text), wire.clone());
    let begun = bench.node().bus().now();
    (bench, wire, begun)
}

/// Runs until the node stops, for `seconds` at most; returns all records.
fn until_stop(bench: &mut Bench<Wire>, seconds: f64) -> Vec<Record> {
    let mut records = Vec::new();
    while bench.elapsed().as_secs_f64() < seconds {
        records.push(bench.cycle());
        if records.last().unwrap().cause.is_some() {
            break;
        }
    }
    records
}

#[test]
fn hazard_13_held_torque_is_seen_and_its_drive_disabled() {
    for (name, config, time) in without_timer() {
        for joint in [2, 3] {
            // The command ends, and the drive that no longer receives it does not.
            let end = "[[console]]\nat_s = 1.1\nrequest = \"disarm\"\n";
            let lost = lost_rpdo(joint, 1.0, "");
            let (mut bench, wire, _) = booted(&config, &format!("{HOLD}{end}{lost}"));
            let records = until_stop(&mut bench, 3.0);
            let stop = records.last().unwrap();
            let place = Joint::ALL[joint - 1];
            assert_eq!(stop.cause, Some(Cause::TargetNotTaken { joint: place }), "{name}");
            assert_eq!(stop.mode, Mode::ZeroTorque, "{name}");
            let left = records.iter().rposition(|it| it.mode == Mode::Engaged).unwrap();
            let seen = stop.at.since(records[left].at);
            assert!(seen <= time, "{name}, joint {joint}: {seen:?} after disarming, not {time:?}");
            bench.cycle();
            let cob_id = 0x200 + u16::try_from(joint).unwrap();
            let sent = wire.since(stop.at, cob_id);
            assert!(sent[0].1.data().starts_with(&[0, 0]), "{name}: disable voltage at once");
        }
    }
}

#[test]
fn hazard_13_lost_rpdos_of_a_moving_arm_are_seen() {
    let moves = "[[move]]\nat_s = 0.6\nduration_s = 1.5\nto_m = [0.04, 0.02, 0.0]\n";
    for (name, config, _) in without_timer() {
        let script = format!("{HOLD}{moves}{}", lost_rpdo(3, 1.0, ""));
        let (mut bench, ..) = booted(&config, &script);
        let records = until_stop(&mut bench, 3.0);
        let cause = records.last().unwrap().cause;
        assert_eq!(cause, Some(Cause::TargetNotTaken { joint: Joint::of::<3>() }), "{name}");
    }
}

#[test]
fn hazard_13_single_lost_rpdo_stops_no_drive() {
    let moves = "[[move]]\nat_s = 0.6\nduration_s = 1.0\nto_m = [0.04, 0.02, 0.0]\n";
    let lost: String =
        (0_u32..12).map(|nth| lost_rpdo(3, 0.7 + 0.0737 * f64::from(nth), "count = 1")).collect();
    for (name, config, _) in without_timer() {
        let (mut bench, ..) = booted(&config, &format!("{HOLD}{moves}{lost}"));
        let records = until_stop(&mut bench, 2.0);
        assert_eq!(records.last().unwrap().cause, None, "{name}");
    }
}

#[test]
fn promise_14_readings_of_held_targets_never_stop_the_node() {
    for (name, config, _) in without_timer() {
        let (mut bench, ..) = booted(&config, PRESS);
        let records = until_stop(&mut bench, 10.0);
        assert_eq!(records.last().unwrap().cause, None, "{name}");
    }
}

/// Motion of a grip that is let go while the RPDOs of one joint are lost.
#[derive(Clone, Copy, Debug, Default)]
struct Push {
    /// Largest speed of the grip, in m/s.
    speed: f64,
    /// Largest distance from where it was let go, in m.
    travel: f64,
    /// Time from the release until the held torque is detected.
    seen: Duration,
}

/// Time from the cause until disable voltage, by SDO, has acted: a gap between two requests, and two cycles.
const DISABLED_AFTER: Duration = Duration::from_millis(14);

/// Presses into the wall as the shipped scenario, and from 7.0 s on by 12 cm.
fn press() -> String {
    let press = PRESS.replace("[[switch]]\nat_s = 9.6\ndeadman = false\n", "");
    press.replace("to_m = [0.055, 0.0, 0.0]", "to_m = [0.12, 0.0, 0.0]")
}

/// Lets go of the grip at `at_s` in the script, when the RPDOs of `joint` are lost, if any.
fn let_go(bench: &Bench<()>, config: &Config, joint: Option<usize>, at_s: f64) -> Push {
    let lost = joint.map_or(String::new(), |joint| lost_rpdo(joint, at_s, ""));
    let hands = format!(
        "[[hold]]\nat_s = {at_s}\nholding = false\n[[switch]]\nat_s = {at_s}\ndeadman = false\n"
    );
    let mut bench = bench.clone();
    bench.follow(script(&format!("{}{hands}{lost}", press())), 1);
    while bench.elapsed().as_secs_f64() < at_s {
        bench.cycle();
    }
    let grip = |bench: &mut Bench<()>| bench.world_mut().plant().x_0_g().translation.vector;
    let (from, mut before) = (grip(&mut bench), grip(&mut bench));
    let let_go_at = bench.node().bus().now();
    let mut push = Push::default();
    let mut stopped: Option<Instant> = None;
    let period = config.period.as_secs_f64();
    loop {
        let record = bench.cycle();
        let now = bench.node().bus().now();
        let place = grip(&mut bench);
        push.speed = push.speed.max((place - before).norm() / period);
        push.travel = push.travel.max((place - from).norm());
        before = place;
        if stopped.is_none() && matches!(record.cause, Some(Cause::TargetNotTaken { .. })) {
            stopped = Some(now);
            push.seen = now.since(let_go_at);
        }
        let end = stopped.map_or(let_go_at + Duration::from_millis(200), |at| at + DISABLED_AFTER);
        if now >= end {
            return push;
        }
    }
}

#[test]
fn hazard_13_released_grip_stays_below_half_a_metre_per_second() {
    for (name, config, _) in without_timer() {
        let mut bench = started(&config, script(&press()), ());
        // In motion into the wall, in contact, and pressed by 12 cm.
        for at_s in [3.35, 4.0, 7.6] {
            while bench.elapsed().as_secs_f64() < at_s - 0.01 {
                bench.cycle();
            }
            let healthy = let_go(&bench, &config, None, at_s);
            for joint in 1..=6 {
                let push = let_go(&bench, &config, Some(joint), at_s);
                let case = format!("{name}: at {at_s} s, joint {joint}");
                assert!(push.speed < 0.5, "{case}: {push:?}");
                // The release of a healthy arm causes nearly the same value.
                assert!(push.speed < healthy.speed + 0.16, "{case}: {push:?}, {healthy:?}");
            }
        }
    }
}
