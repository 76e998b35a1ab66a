//! Walls that the hand cannot meet as one should are named by `check` and `demo`, which go on.

use crate::common::prelude::*;

const STRETCHED: &str = include_str!("../../config/scenarios/stretched.toml");

/// Returns the output of `demo` for a wall of the scenario at x in m.
fn warned(x: &str) -> String {
    let moved = STRETCHED.replacen("wall_point_m = [0.55,", &format!("wall_point_m = [{x},"), 1);
    assert_ne!(moved, STRETCHED, "the scenario moves the wall to 0.55 m");
    let file = folder("walls", x).join("wall.toml");
    fs::write(&file, moved).unwrap();
    let ended = frhc(&["demo", "--seconds", "0.5", "--scenario", file.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    ended.stderr
}

#[test]
fn wall_that_no_posture_reaches_is_named() {
    let stderr = warned("0.75");
    assert!(stderr.contains("wall 0.330 m from the start, in pose mode: no posture"), "{stderr}");
}

#[test]
fn object_that_starts_in_the_wall_is_named() {
    let stderr = warned("0.30");
    assert!(stderr.contains("the object starts 0.120 m in the wall"), "{stderr}");
}

#[test]
fn wall_in_reach_is_not_named() {
    for x in ["0.47", "0.53"] {
        let stderr = warned(x);
        assert!(!stderr.contains("wall"), "{stderr}");
    }
}

/// Returns the first line of `check` and the one about the wall, for `kraft_like.toml` with this change.
fn checked(name: &str, from: &str, to: &str) -> [String; 2] {
    let text = fs::read_to_string(KRAFT).unwrap();
    assert!(text.contains(from), "{from}");
    let root = env!("CARGO_MANIFEST_DIR");
    let text = text.replacen(from, to, 1).replace("../eds", &format!("{root}/eds"));
    let file = folder("walls", name).join("arm.toml");
    fs::write(&file, text).unwrap();
    let ended = frhc(&["check", "--config", file.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let line = |start: &str| ended.stdout.lines().find(|line| line.contains(start)).unwrap();
    [line("arm.toml: "), line("contact ")].map(str::to_owned)
}

#[test]
fn way_that_ends_at_the_start_is_explained_with_its_key() {
    for (name, from, to, reason) in [
        (
            "singular",
            "rest_deg = 95.0",
            "rest_deg = 0.0",
            "the arm starts in a singular posture, or at the end of its reach: smallest singular value 0.000; \
             start the joints elsewhere: start_deg (start_m), else rest_deg (rest_m)",
        ),
        (
            "gain",
            "pose_gain = [1.0, 1.0, 1.0,",
            "pose_gain = [0.0, 0.0, 0.0,",
            "wall out of reach, in pose mode: controller.pose_gain along",
        ),
        (
            "far",
            "point_m = [0.47,",
            "point_m = [4.0,",
            "move remote.wall.point_m towards the object",
        ),
    ] {
        let [verdict, contact] = checked(name, from, to);
        assert!(verdict.ends_with(": valid, but the hand does not reach the wall"), "{verdict}");
        assert!(contact.starts_with("contact warning ") && contact.contains(reason), "{contact}");
        assert!(!contact.contains("after 0.000 m") && !contact.contains("NaN"), "{contact}");
    }
}
