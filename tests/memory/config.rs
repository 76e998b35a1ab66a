//! Invalid configurations: each is refused with file, line and key.

use crate::common::prelude::*;
use crate::common::refusals::{are_refused, with_value};

/// Returns the lines of [`KRAFT_TEXT`] that set a key: line number from 1, and key.
pub(crate) fn keys() -> impl Iterator<Item = (usize, &'static str)> {
    (1..).zip(KRAFT_TEXT.lines()).filter_map(|(number, line)| {
        let (key, _) = line.split_once(" = ")?;
        (!key.starts_with('#')).then_some((number, key))
    })
}

/// Returns [`KRAFT_TEXT`] with one line changed.
pub(crate) fn with(number: usize, change: impl Fn(&str) -> String) -> String {
    let lines = (1..).zip(KRAFT_TEXT.lines());
    let changed = lines.map(|(at, line)| if at == number { change(line) } else { line.to_owned() });
    changed.collect::<Vec<_>>().join("\n")
}

#[test]
fn shipped_configurations_are_accepted() {
    for file in shipped() {
        config(&file);
    }
}

#[test]
fn non_finite_number_is_refused_with_its_line() {
    for (number, key) in keys() {
        // Each number of the line, without its comment.
        let line = KRAFT_TEXT.lines().nth(number - 1).unwrap();
        let (_, value) = line.split_once(" = ").unwrap();
        let value = value.split('#').next().unwrap();
        let is_float = |word: &&str| word.contains('.') && word.parse::<f64>().is_ok();
        for word in value.split(['[', ']', ',', ' ']).filter(is_float) {
            let at = word.as_ptr().addr() - line.as_ptr().addr();
            for wrong in ["nan", "inf", "-inf"] {
                let text =
                    with(number, |_| format!("{}{wrong}{}", &line[..at], &line[at + word.len()..]));
                let refusal = refusal(KRAFT, &text);
                assert!(refusal.contains(key), "{line} with {wrong}: {refusal}");
                assert!(refusal.contains(&format!("{KRAFT}:{number}")), "{line}: {refusal}");
            }
        }
    }
}

#[test]
fn missing_key_is_named() {
    let optional = [
        "rest_deg",
        "start_deg",
        "contact_fade_n",
        "torque_rise_s",
        "damping_never_pulls",
        "one_sided",
        "min_singular_value",
        "max_grip_friction_n",
    ];
    for (number, key) in keys().filter(|(_, key)| !optional.contains(key)) {
        let refusal = refusal(KRAFT, &with(number, |_| String::new()));
        assert!(refusal.contains(&format!("missing field `{key}`")), "{number}: {refusal}");
    }
}

#[test]
fn unknown_key_is_named_with_its_line() {
    for (number, key) in keys() {
        let refusal = refusal(KRAFT, &with(number, |line| format!("{line}\n{key}_x = 1")));
        let unknown = format!("{KRAFT}:{}: ", number + 1);
        assert!(refusal.contains(&unknown), "{refusal}");
        assert!(refusal.contains(&format!("{key}_x: unknown key")), "{refusal}");
    }
}

#[test]
fn renamed_keys_are_refused_with_their_new_names() {
    for (before, now) in [("calm_n", "contact_threshold_n"), ("calm_s", "contact_release_s")] {
        let refusal = refusal(KRAFT, &KRAFT_TEXT.replace(now, before));
        let expected = format!("controller.passivity.{before}: was renamed to {now}");
        assert!(refusal.contains(&expected) && refusal.lines().count() == 1, "{refusal}");
    }
    let old = "ramp_s = 0.3\ncalm_n = 0.2\ncalm_nm = 0.02";
    let refusal = refusal(KRAFT, &KRAFT_TEXT.replacen("ramp_s = 0.3", old, 1));
    for (before, now) in [("calm_n", "wait_below_n"), ("calm_nm", "wait_below_nm")] {
        let expected = format!("controller.engagement.{before}: was renamed to {now}");
        assert!(refusal.contains(&expected), "{refusal}");
    }
}

#[test]
fn all_problems_are_reported_together() {
    let text = KRAFT_TEXT
        .replace("a_m = 0.254", "a_m = 99.0")
        .replace("preset = \"consistent\"", "preset = \"hopeful\"")
        .replace("missing_samples = 3", "missing_samples = 300");
    let refusal = refusal(KRAFT, &text);
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
        "joint[2].a_m: invalid type: string \"long\", expected a number",
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
    let text =
        more.iter().fold(changed(KRAFT_TEXT, &[(wrong.0, wrong.1)]), |text, (from, to, _)| {
            assert!(text.contains(from) || text.contains(to), "{from}");
            text.replacen(from, to, 1)
        });
    let refusal = refusal(KRAFT, &text);
    let reasons = more.map(|(.., reason)| reason);
    for reason in reasons.into_iter().chain([wrong.2]) {
        let found = refusal.lines().find(|line| line.contains(reason));
        let line =
            found.and_then(|found| found.strip_prefix(KRAFT)?.strip_prefix(':')?.split(':').next());
        assert!(line.is_some_and(|line| line.parse::<usize>().is_ok()), "{reason}: {refusal}");
    }
    assert_eq!(refusal.lines().count(), more.len() + 1, "{refusal}");
}

#[test]
fn inconsistent_values_are_refused() {
    let singular = "[[1, 1, 0, 0, 0, 0], [1, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0], \
        [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]";
    let rows = [
        ("joint[1].node_id", "1", "must be unique on its bus, got 1 twice"),
        ("node.node_id", "200", "must be a node-id within 1..=127, got 200"),
        ("joint[0].bus", "\"ankle\"", "no bus is called \"ankle\""),
        ("joint[0].product_code", "0x0402_0011", "vendor 00000F8Ch product 04020011h"),
        ("joint[2].limit_deg", "[140.0, 0.0]", ""),
        ("joint[0].torque_curve", "[0.0, 0.0, 0.0]", ""),
        ("joint[4].kind", "\"screw\"", "unknown value \"screw\""),
        ("joint[2].rest_deg", "145.0", "the joint would rest out of"),
        ("joint[2].max_force_n", "4.0", "a revolute joint has"),
        ("safety.rpdo_timer_ms", "1", "1 ms is less than two"),
        ("safety.node_lost_ms", "9", ""),
        ("bus[0].layout", "\"groups\"", "unknown value \"groups\""),
        ("remote.wall.normal", "[0.0, 0.0, 0.0]", ""),
        ("coupling.matrix", singular, "the matrix is singular"),
        ("controller.deadband_m", "[0.0, 0.01, 0.01]", ""),
        ("controller.torque_rise_s", "0.0", "the torque rise time"),
        ("controller.passivity.lever_m", "-0.1", "must be within 0.000001..=1000000, got -0.1"),
        ("controller.soft_stops.margin", "0.7", "must be within 0.001..=0.5, got 0.7"),
    ];
    are_refused(KRAFT, KRAFT_TEXT, &rows);
    for (key, value, reason) in [
        ("node.sync_period_us", "500", "bus[0].load_limit_percent: "),
        ("bus[0].layout", "\"per-drive\"", "bus[0].load_limit_percent: bus load of 14"),
    ] {
        let refusal = refusal(KRAFT, &with_value(KRAFT_TEXT, key, value).0);
        assert!(refusal.contains(reason), "{reason}: {refusal}");
    }
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
    let text = KRAFT_TEXT.replacen("[safety]\n", MORE_LISTS, 1);
    let text = text.replacen("[arm]\n", "[arm]\ngrip_rad = [0, 0, 0]\n", 1);
    let text = text.replacen(
        "\n[[joint]]\nname = \"elevation\"",
        "\n[joint.simulated]\n\
        torque_curve_reverse = [130.0, 0.0, 0.0]\n\n[[joint]]\nname = \"elevation\"",
        1,
    );
    let config = Config::parse(Path::new(KRAFT), &text);
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
            let refusal = refusal(KRAFT, &changed.collect::<Vec<_>>().join("\n"));
            let expected = format!("{key}: must be a list of {length}, got {found}");
            assert!(refusal.starts_with(&format!("{KRAFT}:{number}: ")), "{wrong}: {refusal}");
            assert!(
                refusal.ends_with(&expected) && refusal.lines().count() == 1,
                "{wrong}: {refusal}"
            );
        }
        lists += 1;
    }
    assert_eq!(lists, 56);
    let row = text.replacen("[0, 1, 0, 0, 0, 0],", "[0, 1, 0, 0, 0, 0, 0],", 1);
    let found = refusal(KRAFT, &row);
    assert!(found.contains("coupling.matrix[1]: must be a list of 6, got 7"), "{found}");
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
        let text = fs::read_to_string(file).unwrap();
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
    let (gravity, inertia, name) =
        ("arm.gravity_m_per_s2", "joint[1].inertia_kg_m2", "joint[1].name");
    let weightless = "must be 1 to 20 m/s² long, got 0.0; an arm that springs carry says gravity_balanced = true";
    let rows = [
        (gravity, "[0.0, 0.0, -9810.0]", "must be 1 to 20 m/s² long, got 9810.0"),
        (gravity, "[0.0, 0.0, 0.0]", weightless),
        (inertia, "[-0.0007, 0.0045, 0.0046, 0, 0, 0]", "must be positive about every axis, got"),
        (inertia, "[0.0007, 0.0045, 0.0046, 0.004, 0, 0]", "must be positive"),
        (inertia, "[0.0007, 0.0095, 0.0046, 0, 0, 0]", "must be that of a body: no principal"),
        ("joint[1].centre_of_mass_m", "[0.11, 900.0, 0.01]", "must be within 2 m of the"),
        (name, "\"azimuth\"", "must be unique, got \"azimuth\" twice"),
        (name, "\"\"", "must not be empty"),
        (name, "\" elevation\"", "must not begin or end with blanks"),
        (name, r#""a\nb""#, r#"must have printable characters alone, got "a\nb""#),
        (name, r#""\u001B[2Ja""#, "must have printable"),
        (name, r#""\u202Eba""#, "must have printable"),
        (name, "\"0123456789012345678901234567890123\"", "must have at most 32 characters, got 34"),
        ("bus[0].name", r#""joi\tnts""#, "must have printable"),
        (
            "bus[0].interface",
            r#""v\u001Bn""#,
            r#"must be a name of a Linux interface, got "v\u{1b}n""#,
        ),
        ("bus[0].interface", "\"a/b\"", "must be a name of a Linux interface, got \"a/b\""),
    ];
    are_refused(KRAFT, KRAFT_TEXT, &rows);
    let heavy = refusal(KRAFT, &with_value(KRAFT_TEXT, "joint[5].mass_kg", "5.28").0);
    assert!(heavy.contains("joint[1].max_torque_nm: must hold the arm at its start: "), "{heavy}");
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
        parse(KRAFT, &KRAFT_TEXT.replacen(from, to, 1));
    }
}

#[test]
fn empty_or_incomplete_configuration_is_refused() {
    assert!(refusal(KRAFT, "").contains("missing field `node`"));
    assert!(refusal(KRAFT, "[node\n").starts_with("config/kraft_like.toml:1: "));
    let joints = KRAFT_TEXT.find("[[joint]]").unwrap();
    let switches = KRAFT_TEXT.find("[switches]").unwrap();
    let one = format!(
        "{}{}",
        &KRAFT_TEXT[..KRAFT_TEXT[joints + 1..].find("[[joint]]").unwrap() + joints + 1],
        &KRAFT_TEXT[switches..]
    );
    assert!(refusal(KRAFT, &one).contains("joint: 1 joints; a hand controller has 6"));
}

/// Returns the files of config/ and config/drives/.
pub(crate) fn shipped() -> Vec<String> {
    let files = ["config", "config/drives"].map(|folder| fs::read_dir(folder).unwrap());
    let files = files.into_iter().flatten().map(|file| file.unwrap().path());
    let files = files.filter(|file| file.extension().is_some_and(|one| one == "toml"));
    files.map(|file| file.to_str().unwrap().to_owned()).collect()
}
