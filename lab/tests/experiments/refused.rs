//! Robots and settings that are refused at the terminal: exit code 3, with file, key, value and remedy, and no results.

use crate::common::prelude::*;

const PUMA_TEXT: &str = include_str!("../../../config/robots/puma560.toml");
const KRAFT_TEXT: &str = include_str!("../../../config/kraft_like.toml");
const DUAL_PEG: &str = include_str!("../../config/dual_peg.toml");

/// Writes a file into the folder of a test.
fn written(folder: &Path, name: &str, text: &str) -> PathBuf {
    let file = folder.join(name);
    fs::write(&file, text).unwrap();
    file
}

/// Asserts that a command is refused with these words, each once, and leaves no results.
#[track_caller]
fn is_refused(args: &[&str], words: &[&str], results: &Path) {
    let ended = frhc(args);
    assert_eq!(ended.code, 3, "{args:?}: {}", ended.stderr);
    for word in words {
        assert_eq!(ended.stderr.matches(word).count(), 1, "{word}: {}", ended.stderr);
    }
    assert!(!results.exists(), "{args:?} has left results");
}

#[test]
fn invalid_robots_are_refused_and_leave_no_results() {
    let folder = folder("experiments", "robots");
    let results = folder.join("results");
    let out = results.to_str().unwrap();
    let joint = &PUMA_TEXT[PUMA_TEXT.rfind("[[joint]]").unwrap()..];
    let inside = ("base_m = [-0.31630315,", "base_m = [-0.18,");
    for (name, text, words) in [
        (
            "five.toml",
            changed(PUMA_TEXT, &[(joint, "")]),
            ["joint: an arm must have 6 to 9 joints, got", "5: add or remove [[joint]]"],
        ),
        (
            "in_the_wall.toml",
            changed(PUMA_TEXT, &[inside]),
            ["would start in a surface, at (0.536, ", "change start_deg or base_m"],
        ),
    ] {
        let file = written(&folder, name, &text);
        let robot = file.to_str().unwrap();
        let args = ["experiment", "ntrfc", "--short", "--robot", robot, "--out", out];
        is_refused(&args, &[words[0], words[1], name], &results);
    }
}

#[test]
fn invalid_pegs_are_refused_and_leave_no_results() {
    let folder = folder("experiments", "pegs");
    let results = folder.join("results");
    for (name, old, new, words) in [
        (
            "narrow.toml",
            "radius_m = 0.01012",
            "radius_m = 0.0099",
            ["holes.radius_m: must be above pegs.radius_m = 0.01, got 0.0099", "widen the holes"],
        ),
        (
            "fast.toml",
            "accommodation_m_per_ns = 0.0002",
            "accommodation_m_per_ns = 0.001",
            ["control.accommodation_m_per_ns: K_FA k_e", "at most 2.50e-4 m/s per N"],
        ),
        (
            "turned.toml",
            "height_m = 0.030",
            "height_m = 0.001",
            [
                "start.height_m: must be above 0.0014, got 0.001",
                "start higher, or lower misalignment_deg",
            ],
        ),
    ] {
        let text = changed(DUAL_PEG, &[(old, new)]);
        let text = text.replace("\"../../", &format!("\"{ROOT}/"));
        let file = written(&folder, name, &text);
        let out = results.to_str().unwrap();
        let settings = file.to_str().unwrap();
        let args = ["experiment", "dual-peg", "--short", "--settings", settings, "--out", out];
        is_refused(&args, &[&words[..], &[name]].concat(), &results);
    }
}

#[test]
fn arm_without_a_switch_box_is_refused() {
    let folder = folder("experiments", "no-switch-box");
    let (before, after) = KRAFT_TEXT.split_once("\n[switches]\n").unwrap();
    let (_, after) = after.split_once("\n[controller]\n").unwrap();
    let text = format!("{before}\n[controller]\n{after}").replace("\"../", &format!("\"{ROOT}/"));
    let file = written(&folder, "arm.toml", &text);
    let (file, results) = (file.to_str().unwrap(), folder.join("results"));
    for experiment in ["fidelity", "return-to-centre", "torque-curve"] {
        let out = results.to_str().unwrap();
        let args = ["experiment", experiment, "--short", "--config", file, "--out", out];
        is_refused(&args, &[file, "nothing can be armed: there is no deadman"], &results);
    }
}

#[test]
fn negative_seed_and_unwritable_folder_are_refused() {
    let seed = frhc(&["experiment", "fidelity", "--seed", "-1"]);
    let reason = "'-1' for '--seed <N>': expected a whole number, 0 or above";
    assert!(seed.code == 2 && seed.stderr.contains(reason), "{}", seed.stderr);
    let out = frhc(&["experiment", "fidelity", "--out", "/proc/frhc"]);
    assert!(out.code == 4 && out.stderr.contains("/proc/frhc"), "{}", out.stderr);
}
