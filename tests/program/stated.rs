//! Facts of drives, verified or stated only: what `check` and `plan` print, and how they refuse.

use crate::common::prelude::*;

const FILE: &str = "config/drives/maxon_epos4.toml";

#[test]
fn check_and_plan_print_the_facts_of_each_joint() {
    for command in ["check", "plan"] {
        let ended = frhc(&[command, "--config", FILE]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        for line in [
            "facts all joints       sign stated only, position scale stated only, torque unit verified by 6076h",
            "rest  elbow            at 95.0°, within 5.0°, when armed for the first time after a boot",
            "stops all joints       by heartbeat 22 ms: at most 10.0 N at the grip, half of what the timers allow",
        ] {
            assert!(ended.stdout.lines().any(|it| it == line), "{command}: {}", ended.stdout);
        }
    }
    let ended = frhc(&["check", "--config", KRAFT, "--json"]);
    let report: Value = serde_json::from_str(&ended.stdout).unwrap();
    let facts = &report["facts"][2];
    assert_eq!(facts["joint"], "elbow");
    assert_eq!(facts["stated_only"], serde_json::json!([]));
}

#[test]
fn stated_facts_without_the_key_end_in_exit_3() {
    let text = fs::read_to_string(FILE).unwrap();
    let text = text.replace("accept_stated_only", "# accept_stated_only");
    let sheets = fs::canonicalize("eds").unwrap();
    let text = text.replace("../../eds", sheets.to_str().unwrap());
    let file = folder("stated", "refused").join("arm.toml");
    fs::write(&file, text).unwrap();
    for command in ["check", "plan"] {
        let ended = frhc(&[command, "--config", file.to_str().unwrap()]);
        assert_eq!(ended.code, 3, "{command}: {}", ended.stderr);
        let named =
            "joint[0].accept_stated_only: azimuth, elevation, elbow, pitch, yaw, roll: sign";
        assert_eq!(ended.stderr.matches(named).count(), 1, "{command}: {}", ended.stderr);
    }
}
