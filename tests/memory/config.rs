//! Invalid configurations: each is refused with file, line and key.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::path::Path;

use proptest::prelude::*;

use canopen::object::Object;
use config::Config;
use controller::JointVector;

const FILE: &str = "config/kraft_like.toml";
const TEXT: &str = include_str!("../../config/kraft_like.toml");

fn refusal(text: &str) -> String {
    Config::parse(Path::new(FILE), text).map(|_| ()).unwrap_err().to_string()
}

/// Returns the lines of [`TEXT`] that set a key: line number from 1, and key.
fn keys() -> impl Iterator<Item = (usize, &'static str)> {
    (1..).zip(TEXT.lines()).filter_map(|(number, line)| {
        let (key, _) = line.split_once(" = ")?;
        (!key.starts_with('#')).then_some((number, key))
    })
}

/// Returns [`TEXT`] with one line changed.
fn with(number: usize, change: impl Fn(&str) -> String) -> String {
    let lines = (1..).zip(TEXT.lines());
    let changed = lines.map(|(at, line)| if at == number { change(line) } else { line.to_owned() });
    changed.collect::<Vec<_>>().join("\n")
}

#[test]
fn shipped_configurations_are_accepted() {
    for file in shipped() {
        if let Err(invalid) = Config::load(Path::new(&file)) {
            panic!("{invalid}");
        }
    }
}

#[test]
fn non_finite_number_is_refused_with_its_line() {
    for (number, key) in keys() {
        // Each number of the line, without its comment.
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
fn missing_key_is_named() {
    let optional = [
        "start_deg",
        "contact_fade_n",
        "torque_rise_s",
        "damping_never_pulls",
        "one_sided",
        "min_singular_value",
        "max_grip_friction_n",
    ];
    for (number, key) in keys().filter(|(_, key)| !optional.contains(key)) {
        let refusal = refusal(&with(number, |_| String::new()));
        assert!(refusal.contains(&format!("missing field `{key}`")), "{number}: {refusal}");
    }
}

#[test]
fn unknown_key_is_named_with_its_line() {
    for (number, key) in keys() {
        let refusal = refusal(&with(number, |line| format!("{line}\n{key}_x = 1")));
        let unknown = format!("{FILE}:{}: ", number + 1);
        assert!(refusal.contains(&unknown), "{refusal}");
        assert!(refusal.contains(&format!("{key}_x: unknown key")), "{refusal}");
    }
}

#[test]
fn renamed_keys_are_refused_with_their_new_names() {
    for (before, now) in [("calm_n", "contact_threshold_n"), ("calm_s", "contact_release_s")] {
        let refusal = refusal(&TEXT.replace(now, before));
        let expected = format!("controller.passivity.{before}: was renamed to {now}");
        assert!(refusal.contains(&expected) && refusal.lines().count() == 1, "{refusal}");
    }
    let old = "ramp_s = 0.3\ncalm_n = 0.2\ncalm_nm = 0.02";
    let refusal = refusal(&TEXT.replacen("ramp_s = 0.3", old, 1));
    for (before, now) in [("calm_n", "wait_below_n"), ("calm_nm", "wait_below_nm")] {
        let expected = format!("controller.engagement.{before}: was renamed to {now}");
        assert!(refusal.contains(&expected), "{refusal}");
    }
}

#[test]
fn all_problems_are_reported_together() {
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
fn type_error_hides_no_other_problem() {
    let wrong = (
        "a_m = 0.254",
        "a_m = \"long\"",
        "joint[2].a_m: invalid type: string \"long\", expected f64",
    );
    let more = [
        (
            "missing_samples = 3",
            "missing_samples = 300",
            "safety.missing_samples: must be within 1..=20, got 300",
        ),
        ("preset = ", "pre_set = ", "controller.pre_set: unknown key"),
        ("preset = ", "pre_set = ", "missing field `preset`"),
        (
            "max_force_n = 40.0 ",
            "max_force_n = -40.0 ",
            "controller.max_force_n: must be above zero, got -40",
        ),
        ("gear_ratio = ", "gear_ratio = 0.0 #", "joint[0].gear_ratio: "),
        (
            "bitrate = 1_000_000",
            "bitrate = 1_000_001",
            "bus[0].bitrate: must be one of [10000, 20000, 50000, 125000, 250000, 500000, 800000, 1000000], got 1000001",
        ),
    ];
    let text = more.iter().fold(changed(&[(wrong.0, wrong.1)]), |text, (from, to, _)| {
        assert!(text.contains(from) || text.contains(to), "{from}");
        text.replacen(from, to, 1)
    });
    let refusal = refusal(&text);
    let reasons = more.map(|(.., reason)| reason);
    for reason in reasons.into_iter().chain([wrong.2]) {
        let found = refusal.lines().find(|line| line.contains(reason));
        let line =
            found.and_then(|found| found.strip_prefix(FILE)?.strip_prefix(':')?.split(':').next());
        assert!(line.is_some_and(|line| line.parse::<usize>().is_ok()), "{reason}: {refusal}");
    }
    assert_eq!(refusal.lines().count(), more.len() + 1, "{refusal}");
}

#[test]
fn inconsistent_values_are_refused() {
    for (from, to, reason) in [
        ("sync_period_us = 1000", "sync_period_us = 500", "bus[0].load_limit_percent: "),
        (
            "node_id = 2\n",
            "node_id = 1\n",
            "joint[1].node_id: must be unique on its bus, got 1 twice",
        ),
        (
            "node_id = 127",
            "node_id = 200",
            "node.node_id: must be a node-id within 1..=127, got 200",
        ),
        ("bus = \"joints\"", "bus = \"ankle\"", "joint[0].bus: no bus is called \"ankle\""),
        ("0x0402_0010", "0x0402_0011", "joint[0].product_code: vendor 00000F8Ch product 04020011h"),
        ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 1 ", "safety.rpdo_timer_ms: 1 ms is less than two"),
        ("node_lost_ms = 22", "node_lost_ms = 9", "safety.node_lost_ms: "),
        ("layout = \"grouped\"", "layout = \"groups\"", "bus[0].layout: unknown value \"groups\""),
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
        (
            "torque_rise_s = 0.02",
            "torque_rise_s = 0.0",
            "controller.torque_rise_s: the torque rise time",
        ),
        (
            "lever_m = 0.1",
            "lever_m = -0.1",
            "controller.passivity.lever_m: must be within 0.000001..=1000000, got -0.1",
        ),
        (
            "margin = 0.04",
            "margin = 0.7",
            "controller.soft_stops.margin: must be within 0.001..=0.5, got 0.7",
        ),
        (
            "name = \"yaw\"",
            "name = \"yaw\"\nkind = \"screw\"",
            "joint[4].kind: unknown value \"screw\"",
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

/// Returns [`TEXT`] with replacements, each of the first occurrence.
fn changed(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(TEXT.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

#[test]
fn promise_02_heartbeat_shorter_than_its_cycle_is_refused() {
    let slow = [
        ("sync_period_us = 1000", "sync_period_us = 10000"),
        ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 30 "),
    ];
    for (heartbeat, lost, reasons) in [
        (
            1,
            2,
            [
                "node.heartbeat_ms: must be at least the cycle that sends it, 10000 µs",
                "safety.node_lost_ms: ",
            ],
        ),
        (5, 10, ["node.heartbeat_ms: ", "which leave every 1 cycles: 20000 µs, got 10 ms"]),
        (
            12,
            30,
            ["safety.node_lost_ms: must be at least two", "every 2 cycles: 40000 µs, got 30 ms"],
        ),
    ] {
        let text = changed(&slow);
        let text = text.replacen("heartbeat_ms = 5 ", &format!("heartbeat_ms = {heartbeat} "), 1);
        let text = text.replacen("heartbeat_ms = 5\n", &format!("heartbeat_ms = {heartbeat}\n"), 1);
        let text = text.replacen("node_lost_ms = 22 ", &format!("node_lost_ms = {lost} "), 1);
        let refusal = refusal(&text);
        for reason in reasons {
            assert!(refusal.contains(reason), "{reason}: {refusal}");
        }
    }
}

/// Walls within the workspace, stiff enough to use up the assist.
const WALLS: &str = "[controller.walls]\nat_m = [0.02, 0.02, 0.02]\nat_rad = [1.0, 1.0, 1.0]\n\
    stiffness_n_per_m = [9000.0, 9000.0, 9000.0]\nstiffness_nm_per_rad = [0.0, 0.0, 0.0]\n\n[remote]\n";

#[test]
fn promise_03_force_cap_includes_every_source_of_force() {
    let heartbeat_only = ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 0 ");
    let weak = ("max_force_n = 40.0 ", "max_force_n = 1.0 ");
    let no_stops = ("push = 0.5 ", "push = 0.0 ");
    let no_dampers = ("max_damping_ns_per_m = 75.0", "max_damping_ns_per_m = 1.0");
    let strong_assist = ("assist_fraction = 0.35", "assist_fraction = 1.0");
    let plain = changed(&[heartbeat_only, weak, no_stops, no_dampers, strong_assist]);
    Config::parse(Path::new(FILE), &plain).unwrap();
    for (change, reason) in [
        (("[remote]\n", WALLS), "return to centre and walls"),
        (
            ("centring_n = [2.0, 2.0, 2.0]", "centring_n = [15.0, 15.0, 15.0]"),
            "return to centre and walls",
        ),
        (("push = 0.0 ", "push = 1.0 "), "soft stops"),
        (("max_damping_ns_per_m = 1.0", "max_damping_ns_per_m = 75.0"), "and dampers of 83 N·s/m"),
    ] {
        let refusal = refusal(&plain.replacen(change.0, change.1, 1));
        let found =
            refusal.lines().find(|line| line.contains("for the 25.0 ms until a drive stops"));
        assert!(found.is_some_and(|found| found.contains(reason)), "{reason}: {refusal}");
    }
}

#[test]
fn joint_behind_a_coupling_has_its_own_capacity_and_speed() {
    // The elbow follows its own actuator, and twice the second one in the other direction.
    let coupling = "[coupling]\nmatrix = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, -2, 1, 0, 0, 0], \
        [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]\n\n[switches]\n";
    let config = Config::parse(Path::new(FILE), &changed(&[("[switches]\n", coupling)])).unwrap();
    let stops = config.controller.extensions.soft_stops.unwrap();
    let mut q = config.joints.each_ref().map(|joint| joint.plant.start);
    q[2] = config.joints[2].plant.link.range[1];
    let tau = stops.torques(&q.into(), &JointVector::zeros());
    // Half of the capacity: 6 N·m of the second actuator at a ratio of 2 is less than 4 N·m of the third.
    assert!((tau[2] + 1.5).abs() < 1e-9, "{tau}");
    let speed_of = |config: &Config, joint: usize| {
        let (_, plan) = &config.node_plans()[joint];
        let limit =
            plan.writes().into_iter().find(|(object, _)| *object == Object::MAX_MOTOR_SPEED);
        format!("{:?}", limit.unwrap().1)
    };
    let plain = Config::parse(Path::new(FILE), TEXT).unwrap();
    assert_eq!(speed_of(&config, 1), speed_of(&plain, 1));
    assert_ne!(speed_of(&config, 2), speed_of(&plain, 2), "the third actuator may turn faster");
}

#[test]
fn tank_damper_beyond_the_stable_maximum_is_refused() {
    let tank = |more: &str| {
        let tank = format!(
            "[controller.tank]\ninitial_j = 0.1\nmin_j = 0.0\nlow_j = 0.02\nmax_j = 0.5\n\
             refill_ns_per_m_per_j = 2000.0\n{more}\n[remote]\n"
        );
        let heavy = ("[safety]\n", "[safety]\neffective_mass_kg = 3.0\n");
        let weak = ("max_damping_ns_per_m = 75.0", "max_damping_ns_per_m = 60.0");
        changed(&[weak, ("[remote]\n", &tank), heavy])
    };
    let config = Config::parse(Path::new(FILE), &tank("")).unwrap();
    assert!(config.findings().iter().any(|finding| finding.name == "tank, damper"));
    let refusal = refusal(&tank("max_damping_ns_per_m = 600.0\n"));
    assert!(refusal.contains("controller.tank.max_damping_ns_per_m: tank, damper, "), "{refusal}");
}

/// Sections with lists that are absent from the shipped configuration.
const MORE_LISTS: &str = "[coupling]\n\
    matrix = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], \
    [0, 0, 0, 0, 0, 1]]\noffset_rad_or_m = [0, 0, 0, 0, 0, 0]\n\n\
    [controller.walls]\nat_m = [0.1, 0.1, 0.1]\nat_rad = [1, 1, 1]\nstiffness_n_per_m = [9, 9, 9]\n\
    stiffness_nm_per_rad = [0, 0, 0]\n\n\
    [controller.virtual_coupling]\nstiffness_n_per_m = [400, 400, 400]\nstiffness_nm_per_rad = [2, 2, 2]\n\
    damping_ns_per_m = [2, 2, 2]\ndamping_nms_per_rad = [0.01, 0.01, 0.01]\n\n\
    [remote.sphere]\ncentre_m = [0.4, -0.2, 0.3]\nradius_m = 0.08\nstiffness_n_per_m = 1500\n\
    damping_ns_per_m = 10\n\n[safety]\n";

#[test]
fn hazard_18_list_of_a_wrong_length_is_refused_by_key() {
    let text = TEXT.replacen("[safety]\n", MORE_LISTS, 1);
    let text = text.replacen("[arm]\n", "[arm]\ngrip_rad = [0, 0, 0]\n", 1);
    let text = text.replacen(
        "\n[[joint]]\nname = \"elevation\"",
        "\n[joint.simulated]\n\
        torque_curve_reverse = [130.0, 0.0, 0.0]\n\n[[joint]]\nname = \"elevation\"",
        1,
    );
    let config = Config::parse(Path::new(FILE), &text);
    config.map(|_| ()).unwrap_or_else(|invalid| panic!("{invalid}"));
    let mut lists = 0;
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| line.contains(" = [")) {
        let (key, list) = line.split_once(" = ").unwrap();
        let list = list.split_once(" #").map_or(list, |(list, _)| list).trim_end();
        let inside = list.strip_suffix(']').unwrap();
        let length = if key == "matrix" { 6 } else { list.split(',').count() };
        let shorter = format!("{}]", inside.rsplit_once(',').unwrap().0);
        let longer =
            ["1.0", "\"x\"", "nan", "[]"].map(|more| (format!("{inside}, {more}]"), length + 1));
        let shorter = (key != "matrix").then(|| (shorter, length - 1));
        for (wrong, found) in longer.into_iter().chain(shorter) {
            let changed = (1..).zip(text.lines()).map(|(at, line)| {
                if at == number { format!("{key} = {wrong}") } else { line.to_owned() }
            });
            let refusal = refusal(&changed.collect::<Vec<_>>().join("\n"));
            let expected = format!("{key}: must be a list of {length}, got {found}");
            assert!(refusal.starts_with(&format!("{FILE}:{number}: ")), "{wrong}: {refusal}");
            assert!(
                refusal.ends_with(&expected) && refusal.lines().count() == 1,
                "{wrong}: {refusal}"
            );
        }
        lists += 1;
    }
    assert_eq!(lists, 56);
    let row = text.replacen("[0, 1, 0, 0, 0, 0],", "[0, 1, 0, 0, 0, 0, 0],", 1);
    assert!(
        refusal(&row).contains("coupling.matrix[1]: must be a list of 6, got 7"),
        "{}",
        refusal(&row)
    );
}

#[test]
fn sections_have_no_silently_truncated_arrays() {
    for file in [
        "src/config/raw.rs",
        "src/bench/sim/scenario/mod.rs",
        "src/bench/sim/scenario/operator.rs",
        "src/bench/sim/operator_settings.rs",
        "src/bench/sim/quirks/assignment.rs",
        "src/bench/sim/quirks/quirk.rs",
    ] {
        let text = std::fs::read_to_string(file).unwrap();
        let mut in_section = false;
        for line in text.lines() {
            in_section |= line.contains("derive(") && line.contains("Deserialize");
            assert!(
                !(in_section && line.contains(": [f64;") || line.contains("Option<[")),
                "{file}: {line}"
            );
            in_section &= line != "}";
        }
    }
}

#[test]
fn hazard_18_physically_impossible_arms_are_refused() {
    for (from, to, reason) in [
        (
            "[0.0, 0.0, -9.81]",
            "[0.0, 0.0, -9810.0]",
            "arm.gravity_m_per_s2: must be 1 to 20 m/s² long, got 9810.0",
        ),
        (
            "[0.0, 0.0, -9.81]",
            "[0.0, 0.0, 0.0]",
            "got 0.0; an arm that springs carry says gravity_balanced = true",
        ),
        (
            "0.0007, 0.0045",
            "-0.0007, 0.0045",
            "joint[1].inertia_kg_m2: must be positive about every axis, got",
        ),
        (
            "0.0007, 0.0045, 0.0046, 0.0",
            "0.0007, 0.0045, 0.0046, 0.004",
            "joint[1].inertia_kg_m2: must be positive",
        ),
        (
            "0.0007, 0.0045",
            "0.0007, 0.0095",
            "joint[1].inertia_kg_m2: must be that of a body: no principal",
        ),
        (
            "[0.11, 0.0, 0.01]",
            "[0.11, 900.0, 0.01]",
            "joint[1].centre_of_mass_m: must be within 2 m of the",
        ),
        (
            "name = \"elevation\"",
            "name = \"azimuth\"",
            "joint[1].name: must be unique, got \"azimuth\" twice",
        ),
        ("name = \"elevation\"", "name = \"\"", "joint[1].name: must not be empty"),
        (
            "name = \"elevation\"",
            "name = \" elevation\"",
            "joint[1].name: must not begin or end with blanks",
        ),
        (
            "name = \"elevation\"",
            "name = \"a\\nb\"",
            "joint[1].name: must have printable characters alone, got \"a\\nb\"",
        ),
        ("name = \"elevation\"", "name = \"\\u001B[2Ja\"", "joint[1].name: must have printable"),
        ("name = \"elevation\"", "name = \"\\u202Eba\"", "joint[1].name: must have printable"),
        (
            "name = \"elevation\"",
            "name = \"0123456789012345678901234567890123\"",
            "at most 32 characters, got 34",
        ),
        ("name = \"joints\"", "name = \"joi\\tnts\"", "bus[0].name: must have printable"),
        (
            "interface = \"vcan0\"",
            "interface = \"v\\u001Bn\"",
            "bus[0].interface: must be a name of a Linux interface, got \"v\\u{1b}n\"",
        ),
        (
            "interface = \"vcan0\"",
            "interface = \"a/b\"",
            "bus[0].interface: must be a name of a Linux interface, got \"a/b\"",
        ),
        (
            "mass_kg = 0.28",
            "mass_kg = 5.28",
            "joint[1].max_torque_nm: must hold the arm at its start: ",
        ),
    ] {
        assert!(TEXT.contains(from), "{from}");
        let refusal = refusal(&TEXT.replacen(from, to, 1));
        assert!(refusal.contains(reason), "{reason}: {refusal}");
        assert!(refusal.lines().all(|line| line.starts_with(&format!("{FILE}:"))), "{refusal:?}");
        assert!(!refusal.contains('\u{1b}'), "{refusal:?}");
    }
    let heavy = refusal(&TEXT.replacen("mass_kg = 0.28", "mass_kg = 5.28", 1));
    assert!(heavy.contains("N·m are needed, got 6 N·m; choose another start or motor"), "{heavy}");
}

#[test]
fn hanging_and_balanced_arms_are_accepted() {
    for (from, to) in [
        ("[0.0, 0.0, -9.81]", "[0.0, 0.0, 9.81]"),
        ("[0.0, 0.0, -9.81]", "[0.0, 9.0, -3.9]"),
        ("[0.0, 0.0, -9.81]", "[0.0, 0.0, 0.0]\ngravity_balanced = true"),
        ("[0.0007, 0.0045, 0.0046, 0.0, 0.0, 0.0]", "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"),
        ("[0.0007, 0.0045, 0.0046, 0.0, 0.0, 0.0]", "[0.00009, 0.0045, 0.0046, 0.0, 0.0, 0.0]"),
        ("name = \"elevation\"", "name = \"Höhe (2)\""),
    ] {
        let text = TEXT.replacen(from, to, 1);
        if let Err(invalid) = Config::parse(Path::new(FILE), &text) {
            panic!("{to}: {invalid}");
        }
    }
}

#[test]
fn empty_or_incomplete_configuration_is_refused() {
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
    fn corrupted_configuration_is_parsed_or_refused(at in 0..TEXT.len(), byte in 0x20..0x7F_u8) {
        let mut bytes = TEXT.as_bytes().to_vec();
        bytes[at] = byte;
        if let Ok(text) = String::from_utf8(bytes) {
            Config::parse(Path::new(FILE), &text).ok();
        }
    }
}

/// Returns [`TEXT`] with these lines in the boot section of the switch box or of the last joint.
fn with_boot(of: &str, lines: &str) -> String {
    let (before, after) = TEXT.split_once("\n[switches]\n").unwrap();
    if of == "joint" {
        return format!("{before}\n[joint.boot]\n{lines}\n\n[switches]\n{after}");
    }
    TEXT.replacen("\n[controller]\n", &format!("\n[switches.boot]\n{lines}\n\n[controller]\n"), 1)
}

#[test]
fn invalid_boot_settings_are_refused_by_key() {
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

/// Returns [`TEXT`] with these lines in the simulation section of its first joint.
fn with_simulated(lines: &str) -> String {
    let (first, rest) = TEXT.split_once("\n[[joint]]\nname = \"elevation\"").unwrap();
    format!("{first}\n[joint.simulated]\n{lines}\n\n[[joint]]\nname = \"elevation\"{rest}")
}

#[test]
fn invalid_simulated_drivetrain_is_refused_by_key() {
    for (lines, reason) in [
        (
            "current_loop_us = -1.0",
            "joint[0].simulated.current_loop_us: must be within 0..=10000, got -1",
        ),
        (
            "current_loop_us = nan",
            "joint[0].simulated.current_loop_us: must be within 0..=10000, got NaN",
        ),
        ("backlash_deg = 11.0", "joint[0].simulated.backlash_deg: must be within 0..=10, got 11"),
        (
            "backlash_m = 0.001",
            "joint[0].simulated.backlash_m: a revolute joint has `backlash_deg`",
        ),
        ("hysteresis_n = 0.1", "joint[0].simulated.hysteresis_n: a revolute joint has"),
        ("hysteresis_nm = 7.0", "joint[0].simulated.hysteresis_nm: must be within 0..=6, got 7"),
        (
            "thermal_time_constant_s = 0",
            "joint[0].simulated.thermal_time_constant_s: must be within 0.1..=36000, got 0",
        ),
        ("torque_curve_reverse = [1.0, -9.0, 0.0]", "joint[0].simulated.torque_curve_reverse: "),
        ("backlash = 0.1", "joint[0].simulated.backlash: unknown key"),
    ] {
        let refusal = refusal(&with_simulated(lines));
        assert!(refusal.contains(reason), "{lines}: {refusal}");
        assert!(refusal.contains(&format!("{FILE}:")), "{refusal}");
    }
}

#[test]
fn drivetrain_without_settings_has_the_defaults() {
    let lines = "current_loop_us = 300.0\nbacklash_deg = 0.2\nhysteresis_nm = 0.03\n\
        thermal_time_constant_s = 12.5\ntorque_curve_reverse = [130.0, 0.0, 0.0]";
    let config = Config::parse(Path::new(FILE), &with_simulated(lines)).unwrap();
    let ([first, second, ..], default) = (&config.joints, &config.joints[5].plant.drivetrain);
    let simulated = &first.plant.drivetrain;
    assert!((simulated.current_loop - 300e-6).abs() < 1e-12);
    assert!((simulated.backlash - 0.2_f64.to_radians()).abs() < 1e-12);
    assert_eq!((simulated.hysteresis, simulated.thermal_time_constant), (0.03, 12.5));
    assert_eq!(simulated.torque_curve_reverse, Some([130.0, 0.0, 0.0]));
    assert_eq!(&second.plant.drivetrain, default);
    assert!((default.current_loop - 200e-6).abs() < 1e-12);
    assert_eq!(
        (default.backlash, default.hysteresis, default.torque_curve_reverse),
        (0.0, 0.0, None)
    );
}

#[test]
fn sync_counter_is_configured_in_every_drive() {
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
        ("sync_counter = 1", "node.sync_counter: must be within 2..=240, got 1"),
        ("time_period_ms = 5", "node.time_period_ms: must be within 10..=3600000, got 5"),
    ] {
        let text = TEXT.replacen("[node]\n", &format!("[node]\n{line}\n"), 1);
        assert!(refusal(&text).contains(reason));
    }
}

#[test]
fn boot_settings_are_in_the_plan_of_their_node() {
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
fn remote_environment_accepts_friction_and_a_sphere() {
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
        (
            "radius_m = 0.08",
            "radius_m = 0.01",
            "remote.sphere.radius_m: must be within 0.03..=10, got 0.01",
        ),
        (
            "friction = 0.4",
            "friction = -0.4",
            "remote.sphere.friction: must be within 0..=2, got -0.4",
        ),
        (
            "friction = 0.4",
            "friction = nan",
            "remote.sphere.friction: must be within 0..=2, got NaN",
        ),
        ("friction = 0.4", "frictoin = 0.4", "remote.sphere.frictoin: unknown key"),
        ("radius_m = 0.08\n", "", "missing field `radius_m`"),
        (
            "[remote.box]",
            "[remote.box]\nfriction = 3.0",
            "remote.box.friction: must be within 0..=2, got 3",
        ),
    ] {
        let refusal = refusal(&text.replacen(from, to, 1));
        assert!(refusal.contains(reason), "{reason}: {refusal}");
        assert!(refusal.starts_with(&format!("{FILE}:")), "{refusal}");
    }
}

#[test]
fn hazard_18_invalid_adjustments_are_refused_by_key() {
    let scale = |line: &str| refusal(&format!("{TEXT}\n[controller.scale]\n{line}\n"));
    for (line, found) in [
        (
            "motion = [0.5, 0.9]",
            "controller.scale.motion: must be [low, high] with low within 0..=1 and high within 1..=10, got [0.5, 0.9]",
        ),
        ("rotation = [-0.1, 1.0]", "controller.scale.rotation: must be"),
        ("force = [nan, 1.0]", "controller.scale.force: must be"),
        ("force = [0.0, inf]", "controller.scale.force: must be"),
        ("motion = [0.5]", "2"),
        ("speed = [0.5, 1.0]", "speed"),
    ] {
        assert!(scale(line).contains(found), "{line}: {}", scale(line));
    }
    // Ten times the wrench is more than the loop bears.
    let beyond = scale("force = [0.0, 10.0]");
    assert!(beyond.contains("controller.scale: at motion "), "{beyond}");
    assert!(beyond.contains("force 10: "), "{beyond}");

    let buttons = |lines: &str| refusal(&format!("{TEXT}\n[[switches.button]]\n{lines}\n"));
    for (lines, found) in [
        ("bit = 3\npress = \"align\"", "switches.button[0].bit: must be within 4..=7, got 3"),
        (
            "bit = 4\npress = \"arm\"",
            "switches.button[0].press: expected \"scale motion|rotation|force FACTOR\"",
        ),
        (
            "bit = 4\npress = \"lock rz off\"",
            "switches.button[0].press: a press locks and releases in turn",
        ),
        (
            "bit = 4\npress = \"scale motion 2\"",
            "scale of motion must be within 0.1..=1 (controller.scale.motion), got 2",
        ),
        (
            "bit = 4\npress = \"align\"\n[[switches.button]]\nbit = 4\npress = \"align\"",
            "switches.button[1].bit: another button has this bit",
        ),
        ("bit = 4", "press"),
    ] {
        assert!(buttons(lines).contains(found), "{lines}: {}", buttons(lines));
    }
}

#[test]
fn bounds_of_contact_postures_are_positive() {
    let keys = ["min_singular_value = 0.1 ", "max_grip_friction_n = 0.6 "];
    for key in keys {
        let (name, _) = key.split_once(" = ").unwrap();
        for wrong in ["0.0", "-1.0", "nan", "inf"] {
            let text = TEXT.replace(key, &format!("{name} = {wrong} "));
            let refusal = refusal(&text);
            assert!(refusal.contains(&format!("arm.{name}: must be above zero")), "{refusal}");
        }
    }
}

#[test]
fn wall_of_each_shipped_file_is_met_in_a_good_posture() {
    for file in shipped() {
        let config = Config::load(Path::new(&file)).unwrap();
        let posture = config.wall_contact().unwrap().posture.unwrap();
        assert!(posture.friction_n <= 0.6 && posture.sigma_min >= 0.1, "{file}: {posture:?}");
        assert!(config.contact_bounds.permit(&posture), "{file}");
    }
}

#[test]
fn wall_beyond_the_reach_has_no_posture() {
    let text = TEXT.replace("point_m = [0.47,", "point_m = [0.8,");
    let config = Config::parse(Path::new(FILE), &text).unwrap();
    assert!(config.wall_contact().unwrap().posture.is_err());
    let touching = TEXT.replace("point_m = [0.47,", "point_m = [0.42,");
    let config = Config::parse(Path::new(FILE), &touching).unwrap();
    assert_eq!((config.wall_contact(), config.wall_depth_at_start()), (None, None));
    let inside = TEXT.replace("point_m = [0.47,", "point_m = [0.30,");
    let config = Config::parse(Path::new(FILE), &inside).unwrap();
    assert_eq!(config.wall_contact(), None);
    assert!((config.wall_depth_at_start().unwrap() - 0.12).abs() < 1e-9);
}

/// Returns the files of config/ and config/drives/.
fn shipped() -> Vec<String> {
    let files = ["config", "config/drives"].map(|folder| std::fs::read_dir(folder).unwrap());
    let files = files.into_iter().flatten().map(|file| file.unwrap().path());
    let files = files.filter(|file| file.extension().is_some_and(|one| one == "toml"));
    files.map(|file| file.to_str().unwrap().to_owned()).collect()
}
