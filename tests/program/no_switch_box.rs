//! Commands with a configuration without `[switches]`: all work but those that arm.

use crate::common::prelude::*;

const REASON: &str = "nothing can be armed: there is no deadman; add [switches], a CiA 401 switch box with a deadman of \
                      two contacts";

/// Writes the shipped configuration without its section `[switches]` to a new folder.
fn installation(name: &str) -> (PathBuf, String) {
    let folder = folder("no-switch-box", name);
    let text = fs::read_to_string(KRAFT).unwrap();
    let (before, after) = text.split_once("\n[switches]\n").unwrap();
    let (_, after) = after.split_once("\n[controller]\n").unwrap();
    let eds = fs::canonicalize("eds/frhc_drive.eds").unwrap();
    let before = before.replace("../eds/frhc_drive.eds", &eds.display().to_string());
    let file = folder.join("arm.toml");
    fs::write(&file, format!("{before}\n[controller]\n{after}")).unwrap();
    (folder, file.display().to_string())
}

fn ends(args: &[&str], code: i32) -> CommandOutput {
    let ended = frhc(args);
    assert_eq!(ended.code, code, "{args:?}\n{}{}", ended.stdout, ended.stderr);
    ended
}

#[test]
fn check_warns_of_a_missing_switch_box() {
    let (_, file) = installation("check");
    let checked = ends(&["check", "--config", &file], 0);
    assert!(checked.stdout.contains(REASON), "{}", checked.stdout);
    let json = ends(&["check", "--config", &file, "--json"], 0);
    let json: Value = serde_json::from_str(&json.stdout).unwrap();
    assert_eq!(json["switches"], false);
    let shipped = ends(&["check", "--config", KRAFT], 0);
    assert!(!shipped.stdout.contains("switches"), "{}", shipped.stdout);
}

#[test]
fn plan_export_and_decode_know_six_nodes() {
    let (folder, file) = installation("plan");
    let planned = ends(&["plan", "--config", &file], 0);
    assert!(!planned.stdout.contains("switch"), "{}", planned.stdout);
    let out = folder.join("dcf").display().to_string();
    let exported = ends(&["export", "dcf", "--config", &file, "--out", &out], 0);
    assert_eq!(exported.stdout.lines().count(), 6, "{}", exported.stdout);
    let out = folder.join("dbc").display().to_string();
    ends(&["export", "dbc", "--config", &file, "--out", &out], 0);
    let log = folder.join("bus.log");
    fs::write(&log, "(0.100000) vcan0 080#\n(0.100200) vcan0 190#02\n").unwrap();
    let decoded = ends(&["decode", "--config", &file, &log.display().to_string()], 0);
    assert!(decoded.stdout.contains("SYNC"), "{}", decoded.stdout);
}

#[test]
fn commands_that_arm_refuse_before_they_start() {
    let (_, file) = installation("arm");
    for args in
        [&["demo", "--config", &file][..], &["campaign", "--faults", "1", "--config", &file]]
    {
        let refused = ends(args, 3);
        assert_eq!(refused.stderr, format!("frhc: {file}: {REASON}\n"), "{args:?}");
    }
}

#[test]
fn demo_that_arms_nothing_runs_without_a_switch_box() {
    let (folder, file) = installation("demo");
    let scenario = folder.join("boot.toml");
    fs::write(&scenario, "seconds = 0.2\n").unwrap();
    let scenario = scenario.display().to_string();
    let played = ends(&["demo", "--config", &file, "--scenario", &scenario, "--json"], 0);
    let summary: Value = serde_json::from_str(&played.stdout).unwrap();
    assert!(summary["stopped_by"].is_null(), "{summary}");
}

#[test]
fn switches_section_without_keys_names_each() {
    let (_, file) = installation("keys");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replacen("\n[controller]\n", "\n[switches]\n\n[controller]\n", 1))
        .unwrap();
    let refused = ends(&["check", "--config", &file], 3);
    for key in ["bus", "node_id", "eds", "vendor_id", "product_code", "revision"] {
        let missing = format!("missing field `{key}`");
        assert!(refused.stderr.contains(&missing), "{missing}: {}", refused.stderr);
    }
}
