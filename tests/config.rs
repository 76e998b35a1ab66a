//! Configurations that cannot be used: each is refused in words that name file, line and key.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::path::Path;

use frhc::canopen::object::Object;
use frhc::config::Config;
use proptest::prelude::*;

const FILE: &str = "config/kraft_like.toml";
const TEXT: &str = include_str!("../config/kraft_like.toml");

fn refusal(text: &str) -> String {
    Config::parse(Path::new(FILE), text).map(|_| ()).unwrap_err().to_string()
}

/// The lines of [`TEXT`] that set a key, by number from 1, with the key.
fn keys() -> impl Iterator<Item = (usize, &'static str)> {
    (1..).zip(TEXT.lines()).filter_map(|(number, line)| {
        let (key, _) = line.split_once(" = ")?;
        (!key.starts_with('#')).then_some((number, key))
    })
}

/// [`TEXT`] with one line changed.
fn with(number: usize, change: impl Fn(&str) -> String) -> String {
    let lines = (1..).zip(TEXT.lines());
    let changed = lines.map(|(at, line)| if at == number { change(line) } else { line.to_owned() });
    changed.collect::<Vec<_>>().join("\n")
}

#[test]
fn the_shipped_configurations_are_in_order() {
    for file in
        [FILE, "config/kraft_like_500hz.toml", "config/jpl_like.toml", "config/sixr_spherical.toml"]
    {
        if let Err(invalid) = Config::load(Path::new(file)) {
            panic!("{invalid}");
        }
    }
}

#[test]
fn a_number_that_is_none_is_refused_on_its_line() {
    for (number, key) in keys() {
        // Every number of the line in turn, but not of its comment.
        let line = TEXT.lines().nth(number - 1).unwrap();
        let (_, value) = line.split_once(" = ").unwrap();
        let value = value.split('#').next().unwrap();
        let is_float = |word: &&str| word.contains('.') && word.parse::<f64>().is_ok();
        for word in value.split(['[', ']', ',', ' ']).filter(is_float) {
            let at = word.as_ptr().addr() - line.as_ptr().addr();
            for wrong in ["nan", "inf", "-inf"] {
                let text =
                    with(number, |_| format!("{}{wrong}{}", &line[..at], &line[at + word.len()..]));
                let refusal = refusal(&text);
                assert!(refusal.contains(key), "{line} with {wrong}: {refusal}");
                assert!(refusal.contains(&format!("{FILE}:{number}")), "{line}: {refusal}");
            }
        }
    }
}

#[test]
fn a_missing_key_is_named() {
    let optional = ["start_deg", "torque_rise_s", "one_sided"];
    for (number, key) in keys().filter(|(_, key)| !optional.contains(key)) {
        let refusal = refusal(&with(number, |_| String::new()));
        assert!(refusal.contains(&format!("missing field `{key}`")), "{number}: {refusal}");
    }
}

#[test]
fn an_unknown_key_is_named_with_its_line() {
    for (number, key) in keys() {
        let refusal = refusal(&with(number, |line| format!("{line}\n{key}_x = 1")));
        let unknown = format!("{FILE}:{}: ", number + 1);
        assert!(refusal.contains(&unknown), "{refusal}");
        assert!(refusal.contains(&format!("{key}_x: unknown key")), "{refusal}");
    }
}

#[test]
fn every_problem_is_found_in_one_run() {
    let text = TEXT
        .replace("a_m = 0.254", "a_m = 99.0")
        .replace("preset = \"consistent\"", "preset = \"hopeful\"")
        .replace("missing_samples = 3", "missing_samples = 300");
    let refusal = refusal(&text);
    for key in ["joint[2].a_m", "controller.preset", "safety.missing_samples"] {
        assert!(refusal.contains(key), "{refusal}");
    }
    assert_eq!(refusal.lines().count(), 3, "{refusal}");
}

#[test]
fn what_does_not_fit_together_is_refused() {
    for (from, to, reason) in [
        ("sync_period_us = 1000", "sync_period_us = 500", "bus[0].load_limit_percent: "),
        ("node_id = 2\n", "node_id = 1\n", "joint[1].node_id: 1 is taken on this bus"),
        ("node_id = 127", "node_id = 200", "node.node_id: 200 is no node-id"),
        ("bus = \"joints\"", "bus = \"ankle\"", "joint[0].bus: no bus is called \"ankle\""),
        ("0x0402_0010", "0x0402_0011", "joint[0].product_code: vendor 00000F8Ch product 04020011h"),
        ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 1 ", "safety.rpdo_timer_ms: 1 ms is less than two"),
        ("node_lost_ms = 22", "node_lost_ms = 9", "safety.node_lost_ms: "),
        ("layout = \"grouped\"", "layout = \"groups\"", "bus[0].layout: \"groups\""),
        (
            "layout = \"grouped\"",
            "layout = \"per-drive\"",
            "bus[0].load_limit_percent: bus load of 14",
        ),
        ("limit_deg = [0.0, 140.0]", "limit_deg = [140.0, 0.0]", "joint[2].limit_deg: "),
        ("normal = [-1.0, 0.0, 0.0]", "normal = [0.0, 0.0, 0.0]", "remote.wall.normal: "),
        ("[133.144, -0.393453, 0.0196726]", "[0.0, 0.0, 0.0]", "joint[0].torque_curve: "),
        ("deadband_m = [0.01", "deadband_m = [0.0", "controller.deadband_m: "),
        (
            "[switches]",
            "[coupling]\nmatrix = [[1, 1, 0, 0, 0, 0], [1, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], \
             [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]\n\n[switches]",
            "coupling.matrix: the matrix is singular",
        ),
        ("torque_rise_s = 0.02", "torque_rise_s = 0.0", "controller.torque_rise_s: torque cannot"),
        ("lever_m = 0.1", "lever_m = -0.1", "controller.passivity.lever_m: -0.1 is not within"),
        ("margin = 0.04", "margin = 0.7", "controller.soft_stops.margin: 0.7 is not within"),
        (
            "name = \"yaw\"",
            "name = \"yaw\"\nkind = \"screw\"",
            "joint[4].kind: \"screw\": there is",
        ),
        (
            "start_deg = 95.0",
            "start_deg = 145.0",
            "joint[2].start_deg: the joint would start out of",
        ),
        ("max_torque_nm = 4.0", "max_force_n = 4.0", "joint[2].max_force_n: a revolute joint has"),
    ] {
        assert!(TEXT.contains(from), "{from}");
        let refusal = refusal(&TEXT.replacen(from, to, 1));
        assert!(refusal.contains(reason), "{reason}: {refusal}");
    }
}

#[test]
fn what_is_no_configuration_at_all_is_refused() {
    assert!(refusal("").contains("missing field `node`"));
    assert!(refusal("[node\n").starts_with("config/kraft_like.toml:1: "));
    let joints = TEXT.find("[[joint]]").unwrap();
    let switches = TEXT.find("[switches]").unwrap();
    let one = format!(
        "{}{}",
        &TEXT[..TEXT[joints + 1..].find("[[joint]]").unwrap() + joints + 1],
        &TEXT[switches..]
    );
    assert!(refusal(&one).contains("joint: 1 joints; a hand controller has 6"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_spoilt_configuration_is_read_or_refused(at in 0..TEXT.len(), byte in 0x20..0x7F_u8) {
        let mut bytes = TEXT.as_bytes().to_vec();
        bytes[at] = byte;
        if let Ok(text) = String::from_utf8(bytes) {
            Config::parse(Path::new(FILE), &text).ok();
        }
    }
}

/// [`TEXT`] with these lines before the section of the switches' successor, and at the last joint.
fn with_boot(of: &str, lines: &str) -> String {
    let (before, after) = TEXT.split_once("\n[switches]\n").unwrap();
    if of == "joint" {
        return format!("{before}\n[joint.boot]\n{lines}\n\n[switches]\n{after}");
    }
    TEXT.replacen("\n[controller]\n", &format!("\n[switches.boot]\n{lines}\n\n[controller]\n"), 1)
}

#[test]
fn what_no_node_can_be_booted_by_is_named() {
    for (of, lines, reason) in [
        ("joint", "optional = true", "joint[5].boot.optional: an arm has all its joints"),
        (
            "joint",
            "keep_alive = true",
            "joint[5].boot.keep_alive: what can push always begins anew",
        ),
        ("joint", "revisions = \"newer\"", "joint[5].boot.revisions: "),
        ("switches", "guard_time_ms = 5", "needs a life_time_factor beside it"),
        ("switches", "life_time_factor = 5", "needs a guard_time_ms beside it"),
        ("switches", "guard_time_ms = 0\nlife_time_factor = 2", "switches.boot.guard_time_ms: "),
        ("switches", "guard_time_ms = 50\nlife_time_factor = 9", "more than safety.drive_lost_ms"),
        ("switches", "serial_number = 1", "switches.boot.serial_number: unknown key"),
        (
            "switches",
            "software_version = \"0123456789012345678901234567890123456789\"",
            "is longer than 32 bytes",
        ),
    ] {
        let refusal = refusal(&with_boot(of, lines));
        assert!(refusal.contains(reason), "{lines}: {refusal}");
        assert!(refusal.contains(&format!("{FILE}:")), "{refusal}");
    }
}

/// [`TEXT`] with these lines of its first joint's simulation.
fn with_simulated(lines: &str) -> String {
    let (first, rest) = TEXT.split_once("\n[[joint]]\nname = \"elevation\"").unwrap();
    format!("{first}\n[joint.simulated]\n{lines}\n\n[[joint]]\nname = \"elevation\"{rest}")
}

#[test]
fn what_no_motor_and_gear_can_be_simulated_by_is_named() {
    for (lines, reason) in [
        ("current_loop_us = -1.0", "joint[0].simulated.current_loop_us: -1 is not within 0 and"),
        ("current_loop_us = nan", "joint[0].simulated.current_loop_us: NaN is not within 0 and"),
        ("backlash_deg = 11.0", "joint[0].simulated.backlash_deg: 11 is not within 0 and 10"),
        (
            "backlash_m = 0.001",
            "joint[0].simulated.backlash_m: a revolute joint has `backlash_deg`",
        ),
        ("hysteresis_n = 0.1", "joint[0].simulated.hysteresis_n: a revolute joint has"),
        ("hysteresis_nm = 7.0", "joint[0].simulated.hysteresis_nm: 7 is not within 0 and 6"),
        ("thermal_time_constant_s = 0", "joint[0].simulated.thermal_time_constant_s: 0 is not"),
        ("torque_curve_reverse = [1.0, -9.0, 0.0]", "joint[0].simulated.torque_curve_reverse: "),
        ("backlash = 0.1", "joint[0].simulated.backlash: unknown key"),
    ] {
        let refusal = refusal(&with_simulated(lines));
        assert!(refusal.contains(reason), "{lines}: {refusal}");
        assert!(refusal.contains(&format!("{FILE}:")), "{refusal}");
    }
}

#[test]
fn a_motor_and_gear_of_which_nothing_is_said_are_good_ones() {
    let said = "current_loop_us = 300.0\nbacklash_deg = 0.2\nhysteresis_nm = 0.03\n\
        thermal_time_constant_s = 12.5\ntorque_curve_reverse = [130.0, 0.0, 0.0]";
    let config = Config::parse(Path::new(FILE), &with_simulated(said)).unwrap();
    let ([first, second, ..], good) = (&config.joints, &config.joints[5].simulated);
    let simulated = &first.simulated;
    assert!((simulated.current_loop - 300e-6).abs() < 1e-12);
    assert!((simulated.backlash - 0.2_f64.to_radians()).abs() < 1e-12);
    assert_eq!((simulated.hysteresis, simulated.thermal_time_constant), (0.03, 12.5));
    assert_eq!(simulated.torque_curve_reverse, Some([130.0, 0.0, 0.0]));
    assert_eq!(&second.simulated, good);
    assert!((good.current_loop - 200e-6).abs() < 1e-12);
    assert_eq!((good.backlash, good.hysteresis, good.torque_curve_reverse), (0.0, 0.0, None));
}

#[test]
fn counted_syncs_are_told_to_every_drive_and_counted_on_the_bus() {
    let text = TEXT.replacen("[node]\n", "[node]\nsync_counter = 240\ntime_period_ms = 1000\n", 1);
    let text = text.replace("load_limit_percent = 90", "load_limit_percent = 91");
    let config = Config::parse(Path::new(FILE), &text).unwrap();
    assert_eq!((config.sync_counter, config.time_period.unwrap().as_millis()), (Some(240), 1_000));
    let counting = config.node_plans().into_iter().filter(|(_, plan)| {
        plan.writes().iter().any(|(object, _)| *object == Object::SYNC_OVERFLOW)
    });
    assert_eq!(counting.count(), 6);
    let plain = Config::parse(Path::new(FILE), TEXT).unwrap();
    assert!((config.loads()[0].used - plain.loads()[0].used - 10.0).abs() < 1e-9);
    for (line, reason) in [
        ("sync_counter = 1", "node.sync_counter: 1 is not within"),
        ("time_period_ms = 5", "node.time_period_ms: 5 is not within"),
    ] {
        let text = TEXT.replacen("[node]\n", &format!("[node]\n{line}\n"), 1);
        assert!(refusal(&text).contains(reason));
    }
}

#[test]
fn an_unusual_boot_is_in_the_plan_of_its_node() {
    let lines = "revisions = \"compatible\"\nserial = 7\nsoftware_version = \"0.1.0\"\n\
                 guard_time_ms = 80\nlife_time_factor = 3\noptional = true\nkeep_alive = true";
    let text = with_boot("switches", lines);
    let text = text.replacen("[node]\n", "[node]\nstore_configuration = true\n", 1);
    let config = Config::parse(Path::new(FILE), &text).unwrap();
    let (_, plan) = config.node_plans().pop().unwrap();
    assert!(plan.is_optional && plan.keep_alive && plan.stores_configuration);
    assert_eq!(plan.admission.serial, Some(7));
    assert_eq!(plan.admission.software.unwrap().as_bytes(), b"0.1.0");
    assert_eq!(plan.error_control.lost_after(), std::time::Duration::from_millis(240));
}

#[test]
fn what_the_object_touches_may_be_rough_and_round() {
    let plain = Config::parse(Path::new(FILE), TEXT).unwrap();
    assert!(plain.remote.sphere.is_none());
    assert_eq!(plain.remote.wall.map(|(.., contact)| contact.friction), Some(0.0));
    let sphere = "[remote.sphere]\ncentre_m = [0.4, -0.2, 0.3]\nradius_m = 0.08\n\
                  stiffness_n_per_m = 1500.0\ndamping_ns_per_m = 10.0\nfriction = 0.4\n\n";
    let text = TEXT.replacen("[safety]", &format!("{sphere}[safety]"), 1);
    let config = Config::parse(Path::new(FILE), &text).unwrap();
    let (centre, radius, contact) = config.remote.sphere.unwrap();
    assert_eq!((centre.y, radius, contact.friction), (-0.2, 0.08, 0.4));
    for (from, to, reason) in [
        ("radius_m = 0.08", "radius_m = 0.01", "remote.sphere.radius_m: 0.01 is not within 0.03"),
        ("friction = 0.4", "friction = -0.4", "remote.sphere.friction: -0.4 is not within 0 and 2"),
        ("friction = 0.4", "friction = nan", "remote.sphere.friction: NaN is not within 0 and 2"),
        ("friction = 0.4", "frictoin = 0.4", "remote.sphere.frictoin: unknown key"),
        ("radius_m = 0.08\n", "", "missing field `radius_m`"),
        ("[remote.box]", "[remote.box]\nfriction = 3.0", "remote.box.friction: 3 is not within"),
    ] {
        let refusal = refusal(&text.replacen(from, to, 1));
        assert!(refusal.contains(reason), "{reason}: {refusal}");
        assert!(refusal.starts_with(&format!("{FILE}:")), "{refusal}");
    }
}
