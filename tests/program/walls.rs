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
