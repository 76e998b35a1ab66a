//! Robots and settings that are refused at the terminal: exit code 3, with file, key, value and remedy, and no results.

use crate::common::prelude::*;
use crate::common::refusals::with_value;

const PUMA_TEXT: &str = include_str!("../../config/robots/puma560.toml");

/// A robot file that is invalid, and the words of its refusal.
struct Wrong {
    name: &'static str,
    text: String,
    words: [&'static str; 2],
}

/// Returns robots with five or ten joints, and one that starts beyond a limit.
fn wrong_robots() -> [Wrong; 3] {
    let joint = &PUMA_TEXT[PUMA_TEXT.rfind("[[joint]]").unwrap()..];
    let count = "joint: an arm must have 6 to 9 joints, got";
    [
        Wrong {
            name: "five.toml",
            text: changed(PUMA_TEXT, &[(joint, "")]),
            words: [count, "5: add or remove [[joint]]"],
        },
        Wrong {
            name: "ten.toml",
            text: format!("{PUMA_TEXT}\n{}", joint.repeat(4)),
            words: [count, "10: add or remove [[joint]]"],
        },
        Wrong {
            name: "beyond.toml",
            text: with_value(PUMA_TEXT, "joint[1].start_deg", "230.0").0,
            words: ["joint[1].start_deg: must be within limit_deg", "-45 to 225, got 230"],
        },
    ]
}

/// Returns a robot whose tool is inside the wall of kraft_like.
fn in_the_wall() -> Wrong {
    Wrong {
        name: "in_the_wall.toml",
        text: changed(PUMA_TEXT, &[("base_m = [-0.31630315,", "base_m = [-0.18,")]),
        words: ["would start in a surface, at (0.536, ", "change start_deg or base_m"],
    }
}

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
    let folder = folder("robots", "commands");
    let results = folder.join("results");
    let out = results.to_str().unwrap();
    for wrong in wrong_robots().into_iter().chain([in_the_wall()]) {
        let file = written(&folder, wrong.name, &wrong.text);
        let robot = file.to_str().unwrap();
        let words = [wrong.words[0], wrong.words[1], wrong.name];
        is_refused(&["demo", "--robot", robot, "--out", out], &words, &results);
    }
}

#[test]
fn results_outlive_a_robot_that_is_refused() {
    let folder = folder("robots", "force");
    let (wrong, results) = (in_the_wall(), folder.join("results"));
    let (robot, out) = (written(&folder, wrong.name, &wrong.text), results.to_str().unwrap());
    let short = ["demo", "--seconds", "0.1", "--out", out];
    assert_eq!(frhc(&short).code, 0);
    let again = ["--force", "--robot", robot.to_str().unwrap()];
    assert_eq!(frhc(&[&short[..], &again].concat()).code, 3);
    assert!(results.join("summary.json").exists());
}

#[test]
fn configurations_with_invalid_robots_are_refused() {
    let folder = folder("robots", "configurations");
    fs::create_dir_all(folder.join("eds")).unwrap();
    for eds in ["eds/frhc_drive.eds", "eds/frhc_switches.eds"] {
        fs::copy(eds, folder.join(eds)).unwrap();
    }
    fs::create_dir_all(folder.join("config")).unwrap();
    let config = |robot: &str| {
        let robot = format!("robot = \"{robot}\"");
        let held = [("start_m = [0.4, 0.0, 0.3]", &*robot), ("start_deg = [90.0, 0.0, 90.0]", "")];
        changed(KRAFT_TEXT, &held)
    };
    let check = |text: &str, words: &[&str]| {
        let file = written(&folder, "config/hand.toml", text);
        is_refused(&["check", "--config", file.to_str().unwrap()], words, &folder.join("results"));
    };
    for wrong in wrong_robots() {
        written(&folder, &format!("config/{}", wrong.name), &wrong.text);
        check(&config(wrong.name), &wrong.words);
    }
    let wrong = in_the_wall();
    written(&folder, "config/in_the_wall.toml", &wrong.text);
    check(&config(wrong.name), &["remote.robot: the object", wrong.words[0], wrong.words[1]]);
    written(&folder, "config/puma560.toml", PUMA_TEXT);
    let fast = changed(
        &config("puma560.toml"),
        &[("accommodation_m_per_ns = 0.01 ", "accommodation_m_per_ns = 1.5 ")],
    );
    check(
        &fast,
        &["hand.toml:245: remote.accommodation_m_per_ns: accommodation, z: K_FA k_e T = 3.00"],
    );
}
