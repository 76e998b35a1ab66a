//! Drives that count from power-up: zeroed, armed, rebooted, refused, zeroed and armed again, as docs/zero.md says.

use std::io::Read;

use crate::common::prelude::*;
use crate::common::zero::with_zero;

/// Returns the positions of the joints in a status; `None` for those whose zero is unknown.
fn positions(status: &Value) -> Vec<Option<f64>> {
    status["status"]["q"].as_array().unwrap().iter().map(Value::as_f64).collect()
}

/// Runs `frhc ctl`, which must succeed.
fn succeeds(scratch: &Scratch, words: &str) {
    let (code, text) = scratch.ctl_and_text(words);
    assert_eq!(code, 0, "{words}: {text}");
}

#[test]
fn hazard_51_incremental_drives_are_zeroed_after_each_power_up() {
    let scratch = Scratch::new("zero");
    let text = with_zero(&text(KRAFT), "rest");
    let config = scratch.write("config/incremental.toml", &text);
    let mut candump = Candump::start("vcan0");
    // An operator who only holds the grip.
    let still = scratch.write("still.toml", "seconds = 600.0\n");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", &still]);
    let run = scratch.frhc(&["run", "--config", &config]);
    let status = |words: &str| -> Value {
        let (code, text) = scratch.ctl_and_text(&format!("{words} --json"));
        assert_eq!(code, 0, "{text}");
        serde_json::from_str(&text).unwrap()
    };
    let unknown = status("--wait status");
    assert_eq!(positions(&unknown), [None; 6], "{unknown:#}");
    assert_eq!(unknown["status"]["zero_unknown"].as_array().unwrap().len(), 6);
    let (code, refused) = scratch.ctl_and_text("arm");
    assert_eq!(code, 1);
    assert!(
        refused.contains(
            "joint 3 (elbow): zero unknown: not set since the node started; lay the arm in its rest posture, then `frhc ctl zero \
             --joint elbow`"
        ),
        "{refused}"
    );
    let (code, shown) = scratch.ctl_and_text("zero --show");
    assert!(code == 0 && shown.contains("now   unknown; 95.00° after ctl zero"), "{shown}");
    let (code, set) = scratch.ctl_and_text("--wait zero");
    assert!(code == 0 && set.contains("elbow            zero known, at 95.0"), "{set}");
    succeeds(&scratch, "arm");
    let known = positions(&status("status"));
    assert!((known[2].unwrap().to_degrees() - 95.0).abs() < 1.0, "{known:?}");

    // NMT reset of the elbow's drive, which counts from zero again.
    Process::start("cansend", &["vcan0", "000#8103"]).wait().succeeds();
    candump.until(|line| line.canopen().is_some_and(|(id, data)| id == 0x703 && data == [0]));
    let stopped = candump.mark().nanos;
    candump.until(|line| line.nanos > stopped + 500_000_000);
    succeeds(&scratch, "reset");
    let (code, refused) = scratch.ctl_and_text("arm");
    assert!(code == 1 && refused.contains("joint 3 (elbow): zero unknown: "), "{refused}");
    succeeds(&scratch, "--wait zero");
    succeeds(&scratch, "arm");
    run.terminate().succeeds();
    sim.terminate().succeeds();
}

#[test]
fn hazard_51_homing_ended_by_sigkill_leaves_its_drive_off() {
    let scratch = Scratch::new("killed-homing");
    let config = scratch.write("config/homed.toml", &with_zero(&text(KRAFT), "homing"));
    let mut candump = Candump::start("vcan0");
    let still = scratch.write("still.toml", "seconds = 600.0\n");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", &still]);
    let run = scratch.frhc(&["run", "--config", &config]);
    succeeds(&scratch, "--wait status");
    candump.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x080));
    let begun = candump.mark().nanos;
    candump.until(|line| line.nanos > begun + 1_100_000_000);
    let (zero, _) = scratch.frhc_and_stdout(&["ctl", "zero"]);
    // Mode 6, then operation enabled: the drive homes.
    let is_homing =
        |id: u16, data: &[u8]| id == 0x601 && data.starts_with(&[0x2F, 0x60, 0x60, 0, 6]);
    candump.until(|line| line.canopen().is_some_and(|(id, data)| is_homing(id, data)));
    candump.until(|line| {
        let word = |(id, data): (u16, &[u8])| {
            id == 0x301 && data.first().is_some_and(|it| it & 0x1F == 0x1F)
        };
        line.canopen().is_some_and(word)
    });
    run.kill();
    zero.wait();
    let killed = candump.mark().nanos;
    candump.until(|line| line.nanos > killed + 200_000_000);
    for node in 1..=6 {
        let node = node.to_string();
        let read = ["sdo", "read", &node, "6041", "u16", "-i", "vcan0", "--json"];
        let (process, mut stdout) = scratch.frhc_and_stdout(&read);
        let mut text = String::new();
        stdout.read_to_string(&mut text).unwrap();
        process.wait().succeeds();
        let read: Value = serde_json::from_str(&text).unwrap();
        let word = read["value"].as_u64().unwrap();
        assert_ne!(word & 0x6F, 0x27, "drive {node} is on: {text}");
    }
    let run = scratch.frhc(&["run", "--config", &config]);
    scratch.ctl_and_text("--wait status");
    succeeds(&scratch, "reset");
    let (code, refused) = scratch.ctl_and_text("arm");
    assert!(code == 1 && refused.contains("joint 1 (azimuth): zero unknown: "), "{refused}");
    succeeds(&scratch, "--wait zero");
    succeeds(&scratch, "arm");
    run.terminate().succeeds();
    sim.terminate().succeeds();
}
