//! An armed arm that parks itself, as docs/operation.md says: what `frhc ctl park` prints, and what is refused.

use crate::common::prelude::*;

/// The hand moves the arm away, holds the deadman from 12 s on, and lets go of the grip.
const OPERATOR: &str = "seconds = 600.0\n\
    [[move]]\nat_s = 4.0\nduration_s = 2.0\nto_m = [0.04, 0.06, 0.05]\nto_rad = [0.1, 0.2, -0.1]\n\
    [[switch]]\nat_s = 12.0\ndeadman = true\n[[hold]]\nat_s = 12.1\nholding = false\n\
    [[switch]]\nat_s = 60.0\ndeadman = false\n";

#[test]
fn hazard_52_arm_parks_itself_while_the_deadman_is_held() {
    let scratch = Scratch::new("park");
    let config = scratch.write("config/kraft_like.toml", &text(KRAFT));
    let operator = scratch.write("operator.toml", OPERATOR);
    let mut candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", &operator]);
    let run = scratch.frhc(&["run", "--config", &config]);
    let (code, text) = scratch.ctl_and_text("--wait status");
    assert_eq!(code, 0, "{text}");
    let (code, refused) = scratch.ctl_and_text("park");
    assert!(code == 1 && refused.contains("arm it first; the node is ready"), "{refused}");
    let (code, text) = scratch.ctl_and_text("arm");
    assert_eq!(code, 0, "{text}");
    let armed = candump.mark().nanos;
    candump.until(|line| line.nanos > armed + 8_000_000_000);
    let (code, parked) = scratch.ctl_and_text("park");
    assert_eq!(code, 0, "{parked}");
    let last = parked.lines().last().unwrap_or_default();
    assert_eq!(last, "parked: release the deadman, then `frhc ctl disarm`", "{parked}");
    let elbow = parked.lines().find(|line| line.starts_with("elbow")).unwrap();
    assert!(elbow.ends_with("to      95.0°") && !elbow.contains("95.0° to"), "{parked}");
    let (code, status) = scratch.ctl_and_text("status --json");
    let status: Value = serde_json::from_str(&status).unwrap();
    assert_eq!((code, &status["status"]["hold"]["state"]), (0, &Value::from("arrived")));
    let at = status["status"]["q"][2].as_f64().unwrap().to_degrees();
    assert!((at - 95.0).abs() < 0.5, "{at}");
    let (code, text) = scratch.ctl_and_text("disarm");
    assert_eq!(code, 0, "{text}");
    run.terminate().succeeds();
    sim.terminate().succeeds();
}
