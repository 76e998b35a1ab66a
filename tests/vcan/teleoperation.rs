//! A run of ten seconds, its log from the boot on, a node that is killed, and one without a switch box.

use std::os::unix::fs::PermissionsExt;

use crate::common::log::{Log, NODES};
use crate::common::prelude::*;
use crate::common::rig::seconds;
use crate::recordings::only;

/// Duration of the run after the first SYNC, in s.
const RUN_FOR: f64 = 10.2;

#[test]
fn ten_seconds_of_teleoperation_miss_no_sample() {
    let scratch = Scratch::new("teleoperation");
    let text = fs::read_to_string(KRAFT).unwrap();
    let (_, passivity) = text.split_once("[controller.passivity]").unwrap();
    let (passivity, _) = passivity.split_once("\n[").unwrap();
    let (_, friction) = text.split_once("[controller.friction]").unwrap();
    let (friction, _) = friction.split_once("\n[").unwrap();
    let config = scratch.variant(
        KRAFT,
        &[
            (&format!("[controller.friction]{friction}"), ""),
            (&format!("[controller.passivity]{passivity}"), ""),
            // The task and the arm's weight alone, so that the test can compute the torques itself.
            ("centring_n = [2.0, 2.0, 2.0]", "centring_n = [0.0, 0.0, 0.0]"),
            ("centring_nm = [0.08, 0.08, 0.08]", "centring_nm = [0.0, 0.0, 0.0]"),
            ("damping_ns_per_m = [8.0, 8.0, 8.0] ", "damping_ns_per_m = [0.0, 0.0, 0.0] "),
            ("damping_nms_per_rad = [0.02, 0.02, 0.02]", "damping_nms_per_rad = [0.0, 0.0, 0.0]"),
        ],
    );
    let session = scratch.path("session");
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", "contact_10s"]);
    let run = scratch.frhc(&["run", "--config", &config, "--record", &session]);
    let first_sync = candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80)).nanos;
    candump.until(|line| line.nanos > first_sync + 300_000_000);
    scratch.ctl("--wait arm").succeeds();
    candump.until(|line| line.nanos > first_sync + seconds(RUN_FOR));
    run.terminate().succeeds();
    sim.terminate().succeeds();

    let log = Log::parse(&candump.finish());
    log.has_one_exchange_a_period(0.3, RUN_FOR - 0.2, Duration::from_millis(1), NODES);
    log.ends_with_every_drive_off(NODES);

    let session = only(&session);
    let private = fs::metadata(&session).unwrap().permissions().mode() & 0o777;
    assert_eq!(private, 0o700, "only the owner may read a recording");
    let summary = fs::read_to_string(session.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["missing_samples"], 0, "{summary}");
    // Cycles of the boot, before the proof test, do not count.
    assert!(summary["cycles"].as_u64().unwrap() > 9_900, "{summary}");
    assert!(summary["contact_seconds"].as_f64().unwrap() > 2.0, "{summary}");
    assert_eq!(summary["saturated_cycles"], 0, "{summary}");

    let config = Config::load(config.as_ref()).unwrap();
    let session = fs::read_to_string(session.join("bus.log")).unwrap();
    let compared = crate::common::felt::torques_are_those_of_the_wall(
        &session,
        &config,
        &world::arm(&config.plant()),
    );
    assert!(compared > 1_000, "only {compared} cycles in contact");
}

#[test]
fn drives_of_a_killed_node_are_torque_free_within_their_timer() {
    let timer = Duration::from_millis(5);
    // The scheduler chooses the phase of the cycle; the limit does not depend on it.
    for after_ms in [4_000, 4_613, 5_277] {
        let scratch = Scratch::new(&format!("kill-{after_ms}"));
        let mut candump = Candump::start("vcan0");
        let sim = scratch.frhc(&["sim", "--config", KRAFT, "--scenario", "contact_10s"]);
        let run = scratch.frhc(&["run", "--config", KRAFT]);
        let first_sync =
            candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80)).nanos;
        candump.until(|line| line.nanos > first_sync + 300_000_000);
        scratch.ctl("--wait arm").succeeds();
        candump.until(|line| line.nanos > first_sync + after_ms * 1_000_000);
        run.kill();
        let killed = candump.last_nanos();
        candump.until(|line| line.nanos > killed + 40_000_000);
        sim.terminate().succeeds();

        let log = Log::parse(&candump.finish());
        assert!(log.torque_sent_to(2) != 0 && log.torque_sent_to(3) != 0, "the arm was carried");
        for node in NODES {
            let stopped = log
                .torque_free_after(node)
                .unwrap_or_else(|| panic!("node {node} did not report zero torque"));
            let spare = Duration::from_micros(500);
            assert!(stopped <= timer + spare, "node {node} was torque-free after {stopped:?}");
        }
    }
}

#[test]
fn run_without_a_switch_box_proves_and_refuses_to_arm() {
    let scratch = Scratch::new("no-switch-box");
    let text = fs::read_to_string(KRAFT).unwrap();
    let (_, section) = text.split_once("\n[switches]\n").unwrap();
    let (section, _) = section.split_once("\n[controller]\n").unwrap();
    let config = scratch.variant(KRAFT, &[(&format!("\n[switches]\n{section}"), "")]);
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", "contact_10s"]);
    let run = scratch.frhc(&["run", "--config", &config]);
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x80));
    let refused = scratch.ctl("--wait arm");
    assert_ne!(refused.code, Some(0));
    assert!(refused.stderr.contains("there is no deadman; add [switches]"), "{}", refused.stderr);
    let ended = run.terminate();
    ended.succeeds();
    assert!(ended.stderr.contains("nothing can be armed"), "{}", ended.stderr);
    assert!(ended.stderr.contains("ready: all drives enabled"), "{}", ended.stderr);
    sim.terminate().succeeds();
    let log = Log::parse(&candump.finish());
    log.ends_with_every_drive_off(NODES);
}

/// Returns time in s, level and text of a line of the log.
fn logged(line: &str) -> Option<(f64, &str, &str)> {
    let (seconds, rest) = line.split_once(" s ")?;
    let (level, text) = rest.trim_start().split_once(' ')?;
    Some((seconds.parse().ok()?, level, text))
}

#[test]
fn boot_is_logged_while_it_happens_in_its_order() {
    let scratch = Scratch::new("boot-log");
    let sim = scratch.frhc(&["sim", "--config", KRAFT]);
    let run = scratch.frhc(&["run", "--config", KRAFT]);
    scratch.ctl("--wait arm").succeeds();
    let ended = run.terminate();
    sim.terminate().succeeds();
    ended.succeeds();
    let lines: Vec<_> = ended.stderr.lines().filter_map(logged).collect();
    let times = |text: &str| -> Vec<f64> {
        let found = lines.iter().filter(|(_, level, line)| *level == "INFO" && line.contains(text));
        found.map(|(seconds, ..)| *seconds).collect()
    };
    let stages = [
        (": configuration downloaded", 7),
        ("network: every node is operational", 1),
        (": proof test of its watchdog: emergency 8250h", 6),
        (": proof test of its watchdog: emergency 8130h", 6),
        ("ready: all drives enabled at zero torque", 1),
    ];
    let mut end_of_last = 0.0;
    for (text, count) in stages {
        let times = times(text);
        assert_eq!(times.len(), count, "{text}: {}", ended.stderr);
        assert!(times[0] > end_of_last, "{text} at {} s: {}", times[0], ended.stderr);
        end_of_last = *times.last().unwrap();
    }
    // The log is in the order of the times that it prints.
    assert!(lines.is_sorted_by_key(|(seconds, ..)| *seconds), "{}", ended.stderr);
    assert!(!lines.iter().any(|(_, level, _)| *level == "WARN"), "{}", ended.stderr);
}
