//! The gain check of a configuration: unstable gains are refused with their reason, and `frhc check` prints each inequality.

use crate::common::oracle::list;
use crate::common::prelude::*;
use crate::common::refusals::are_refused;
use controller::stability::finding::Verdict;

const SHIPPED: [&str; 5] =
    [KRAFT, KRAFT_500HZ, JPL, "config/jpl_like_1538hz.toml", "config/sixr_spherical.toml"];

#[test]
fn shipped_gains_are_not_refused() {
    for file in SHIPPED {
        let findings = config(file).findings();
        assert_eq!(findings.len(), 120, "{file}");
        assert!(findings.iter().all(|finding| finding.verdict < Verdict::Refuses), "{file}");
    }
}

/// A virtual coupling too stiff to be stable.
const COUPLING: &str = "[controller.virtual_coupling]\nstiffness_n_per_m = [1e5, 1e3, 1e3]\n\
    stiffness_nm_per_rad = [1.0, 1.0, 1.0]\ndamping_ns_per_m = [0.0, 0.0, 0.0]\n\
    damping_nms_per_rad = [0.0, 0.0, 0.0]\n\n[remote]\n";

const WEAK_HAND: (&str, &str) = ("[safety]", "[operator]\nstiffness_n_per_m = 20.0\n\n[safety]");

#[test]
fn every_kind_of_unstable_gain_is_refused_with_its_reason() {
    for (changes, key, finding) in [
        (
            vec![("[0.3, 0.3, 0.3,", "[6.0, 6.0, 6.0,")],
            "controller.wrench_gain",
            "pose reflection, held",
        ),
        (
            vec![("stiffness_n_per_m = 2000.0", "stiffness_n_per_m = 50000.0")],
            "controller.wrench_gain",
            "pose reflection, held",
        ),
        (
            vec![("damping_nms_per_rad = [0.02,", "damping_nms_per_rad = [30.0,")],
            "controller.damping_nms_per_rad",
            "damping, held, about x",
        ),
        (
            vec![("centring_n = [2.0, 2.0, 2.0]", "centring_n = [2.0, 2.0, 0.05]")],
            "controller.centring_n",
            "return to centre, plateau, z",
        ),
        (
            vec![("centring_nm = [0.08, 0.08", "centring_nm = [0.08, 0.001")],
            "controller.centring_nm",
            "return to centre, plateau, about y",
        ),
        (
            vec![("deadband_m = [0.01,", "deadband_m = [0.0001,")],
            "controller.centring_n",
            "return to centre, held, x",
        ),
        (
            vec![WEAK_HAND, ("accommodation_m_per_ns = 0.01", "accommodation_m_per_ns = 0.0")],
            "remote.accommodation_m_per_ns",
            "rate reflection, held",
        ),
        (
            vec![("rate_gain_per_s = [2.0, 2.0", "rate_gain_per_s = [200.0, 2.0")],
            "controller.wrench_gain",
            "rate reflection, held, x",
        ),
        (
            vec![("accommodation_m_per_ns = 0.01", "accommodation_m_per_ns = 1.1")],
            "remote.accommodation_m_per_ns",
            "accommodation",
        ),
        (
            vec![("damping_ns_per_m = 20.0", "damping_ns_per_m = 3000.0")],
            "remote.accommodation_m_per_ns",
            "accommodation, damper",
        ),
        (
            vec![
                ("accommodation_rad_per_nms = 0.5", "accommodation_rad_per_nms = 999.0"),
                ("stiffness_n_per_m = 2000.0", "stiffness_n_per_m = 120000.0"),
            ],
            "remote.accommodation_rad_per_nms",
            "accommodation",
        ),
        (
            vec![("[remote]\n", COUPLING)],
            "controller.virtual_coupling.stiffness_n_per_m",
            "virtual coupling, held, x",
        ),
    ] {
        let text = changed(KRAFT_TEXT, &changes);
        let refusal = refusal(KRAFT, &text);
        let (_, name) = key.rsplit_once('.').unwrap();
        let line = text.lines().position(|line| line.starts_with(&format!("{name} = "))).unwrap();
        let expected = format!("{KRAFT}:{}: {key}: {finding}", line + 1);
        let line = refusal.lines().find(|line| line.starts_with(&expected));
        let line = line.unwrap_or_else(|| panic!("{expected}: {refusal}"));
        assert!(line.matches(" = ").count() >= 2 && line.contains("must stay below"), "{line}");
    }
}

#[test]
fn unstable_gain_on_several_axes_is_one_error() {
    let text = changed(KRAFT_TEXT, &[("[0.3, 0.3, 0.3,", "[2.7, 2.8, 2.8,")]);
    let refusal = refusal(KRAFT, &text);
    assert_eq!(refusal.lines().count(), 1, "{refusal}");
    assert!(
        refusal.contains("pose reflection, held, z: K_T K_P k_e = 5600 N/m must stay below K_T K_P k_e at ρ = 1 = "),
        "{refusal}"
    );
}

#[test]
fn gain_check_warn_accepts_unstable_gains() {
    let unstable = ("[0.3, 0.3, 0.3,", "[6.0, 0.3, 0.3,");
    let text = |check| changed(KRAFT_TEXT, &[unstable, ("max_moment_nm = 2.0", check)]);
    let warn = text("max_moment_nm = 2.0\ngain_check = \"warn\"");
    let findings = parse(KRAFT, &warn).findings();
    assert!(findings.iter().any(|finding| finding.verdict == Verdict::Refuses));
    let refuse = text("max_moment_nm = 2.0\ngain_check = \"refuse\"");
    assert!(Config::parse(Path::new(KRAFT), &refuse).is_err());
    let neither = text("max_moment_nm = 2.0\ngain_check = \"hope\"");
    let refusal = refusal(KRAFT, &neither);
    assert!(refusal.contains(
        "controller.gain_check: unknown value \"hope\"; expected \"refuse\" or \"warn\""
    ));
}

#[test]
fn negative_operator_impedance_is_refused() {
    let reason = "must be zero or above, got -1";
    let rows = [
        ("operator.stiffness_n_per_m", "-1.0", reason),
        ("operator.damping_ns_per_m", "-1.0", reason),
        ("operator.stiffness_nm_per_rad", "-1.0", reason),
        ("operator.damping_nms_per_rad", "-1.0", reason),
    ];
    are_refused(KRAFT, KRAFT_TEXT, &rows);
}

/// Runs `frhc check` on `text`; returns exit code, stdout and stderr.
fn checked(name: &str, text: &str, json: bool) -> (Option<i32>, String, String) {
    let root = env!("CARGO_MANIFEST_DIR");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&file, text.replace("../eds", &format!("{root}/eds"))).unwrap();
    let mut command = Command::new(crate::common::program());
    command.args(["check", "--config"]).arg(&file).args(json.then_some("--json"));
    let output = command.output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    (output.status.code(), out, err)
}

#[test]
fn check_prints_both_sides_of_every_inequality() {
    let (code, out, _) = checked("fit.toml", KRAFT_TEXT, false);
    assert_eq!(code, Some(0));
    let assert_printed = |verdict: &str, inequality: &str| {
        let line = out.lines().find(|line| line.contains(inequality)).unwrap();
        assert!(line.starts_with(&format!("gains {verdict}")), "{line}");
        assert!(line.contains(" must stay below "), "{line}");
    };
    assert_printed("warns", "damping, y: K_D = 8.00 N·s/m");
    assert_printed(
        "holds",
        "accommodation, servo, z: K_FA k_e τ_s = 0.200 must stay below 1/4 = 0.250",
    );
}

#[test]
fn check_json_has_every_finding() {
    let (code, out, _) = checked("json.toml", KRAFT_TEXT, true);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, list(&report["gains"]).len()), (Some(0), 120));
    for finding in list(&report["gains"]) {
        // An infinite side is null.
        let [left, right] =
            ["left", "right"].map(|side| finding[side]["value"].as_f64().unwrap_or(f64::INFINITY));
        assert_eq!(left < right, finding["verdict"] == "holds", "{finding}");
    }
}

#[test]
fn check_of_refused_gains_ends_with_3() {
    let text = changed(KRAFT_TEXT, &[("[0.3, 0.3, 0.3,", "[6.0, 0.3, 0.3,")]);
    let (code, out, err) = checked("unfit.toml", &text, false);
    assert_eq!((code, out.as_str()), (Some(3), ""));
    let line = text.lines().position(|line| line.starts_with("wrench_gain")).unwrap() + 1;
    let expected = format!("unfit.toml:{line}: controller.wrench_gain: pose reflection, held, x: ");
    assert!(err.contains(&expected), "{err}");
}

/// Runs `stiff-wall` with a wall of `stiffness` N/m; returns exit code, verdict in JSON and stderr.
fn stiff_wall(name: &str, config: &Path, stiffness: &str) -> (i32, String, String) {
    let script = include_str!("../../config/scenarios/stiff-wall.toml");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.toml"));
    fs::write(&file, script.replace("30_000.0", stiffness)).unwrap();
    let [config, file] = [config, &file].map(|file| file.to_str().unwrap());
    let ended = frhc(&["demo", "--json", "--config", config, "--scenario", file]);
    let report: Value = serde_json::from_str(&ended.stdout).unwrap();
    (ended.code, report["verdict"].as_str().unwrap().to_owned(), ended.stderr)
}

#[test]
fn stiff_wall_fails_only_where_the_layer_does_not_bound() {
    for (stiffness, code, verdict) in [
        ("2_000.0", 0, "nothing-to-bound"),
        ("30_000.0", 0, "bounded"),
        ("80_000.0", 1, "not-bounded"),
    ] {
        let (ended, found, err) =
            stiff_wall(&format!("wall-{stiffness}"), Path::new(KRAFT), stiffness);
        assert_eq!((ended, &*found), (code, verdict), "{stiffness} N/m: {err}");
        let is_said = err.contains("the passivity layer does not bound this loop");
        assert_eq!(is_said, code == 1, "{err}");
    }
}

#[test]
fn stiff_wall_out_of_reach_is_said_to_be_not_met() {
    let root = env!("CARGO_MANIFEST_DIR");
    let far = changed(
        KRAFT_TEXT,
        &[("point_m = [0.47,", "point_m = [0.8,"), ("../eds", &format!("{root}/eds"))],
    );
    let config = Path::new(env!("CARGO_TARGET_TMPDIR")).join("far-wall-config.toml");
    fs::write(&config, far).unwrap();
    let (code, verdict, err) = stiff_wall("far-wall", &config, "30_000.0");
    assert_eq!((code, &*verdict), (1, "wall-not-met"));
    assert!(err.contains("the wall was not met"), "{err}");
}

#[test]
fn stop_by_a_fast_hand_names_speed_limit_and_remedy() {
    let script = "seconds = 4\n[[console]]\nat_s = 0.3\nrequest = \"arm\"\n\
        [[move]]\nat_s = 2.5\nduration_s = 0.2\nto_m = [0.14, 0.0, 0.0]\n";
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fast-hand.toml");
    fs::write(&file, script).unwrap();
    let ended = frhc(&["demo", "--scenario", file.to_str().unwrap()]);
    assert_eq!(ended.code, 6, "{}", ended.stderr);
    let said =
        ended.stderr.lines().filter(|line| line.contains("safety.max_grip_speed_m_per_s = 1"));
    assert_eq!(said.count(), 1, "{}", ended.stderr);
}

#[test]
fn shipped_files_start_with_short_warnings() {
    for file in SHIPPED {
        let ended = frhc(&["demo", "--config", file, "--seconds", "1"]);
        assert_eq!(ended.code, 0, "{file}: {}", ended.stderr);
        assert!(ended.stderr.lines().count() <= 1, "{file}: {}", ended.stderr);
        assert!(ended.stderr.lines().all(|line| line.chars().count() <= 120), "{}", ended.stderr);
    }
}
