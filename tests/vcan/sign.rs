//! A drive that is tried alone, as docs/calibration.md says: what `frhc measure sign` prints, and what is on the bus meanwhile.

use std::process::Command;

use crate::common::cli::typed;
use crate::common::prelude::*;
use canopen_tools::candump::Line;

/// No hand is on the arm, and another one holds the deadman for 12 s, time and again.
fn operator() -> String {
    let presses = (0..20).map(|press| {
        let [on, off] = [6.0, 18.0].map(|at| at + 13.0 * f64::from(press));
        format!(
            "[[switch]]\nat_s = {on:.1}\ndeadman = true\n[[switch]]\nat_s = {off:.1}\ndeadman = false\n"
        )
    });
    let presses: String = presses.collect();
    format!("seconds = 600.0\n[[hold]]\nat_s = 0.0\nholding = false\n{presses}")
}

/// Returns the 6072h that an SDO download to node 1 writes.
fn max_torque(line: &str) -> Option<u16> {
    let line = Line::parse(line).ok()?;
    let (0x601, [0x2B, 0x72, 0x60, 0x00, low, high, ..]) = line.canopen()? else { return None };
    Some(u16::from_le_bytes([*low, *high]))
}

#[test]
fn hazard_53_sign_of_a_drive_is_proven_with_a_reduced_limit_alone() {
    let scratch = Scratch::new("sign");
    let apart = text(KRAFT).replace("\n[switches]\n", "\n[switches]\ndeadman_at = \"apart\"\n");
    let config = scratch.write("config/kraft_like.toml", &apart);
    let operator = scratch.write("operator.toml", &operator());
    let candump = Candump::start("vcan0");
    let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", &operator]);
    let run = scratch.frhc(&["run", "--config", &config]);
    let (code, text) = scratch.ctl_and_text("--wait status");
    assert_eq!(code, 0, "{text}");
    let mut measure = Command::new(crate::common::program());
    let measure = measure.args(["measure", "sign", "--config", &config, "--joint", "azimuth"]);
    let measured = typed(scratch.at_home(measure), "\n");
    assert_eq!(measured.code, 0, "{}{}", measured.stdout, measured.stderr);
    assert!(measured.stdout.contains("  joint 1: right\n"), "{}", measured.stdout);
    let (code, text) = scratch.ctl_and_text("--wait status --json");
    let status: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, &status["status"]["mode"]), (0, &Value::from("ready")));
    run.terminate().succeeds();
    sim.terminate().succeeds();
    let limits: Vec<_> = candump.finish().iter().filter_map(|line| max_torque(line)).collect();
    let (planned, reduced) = (limits[0], *limits.iter().min().unwrap());
    assert!(reduced > 0 && reduced <= planned / 10, "{limits:?}");
    assert_eq!(limits.last(), Some(&planned), "{limits:?}");
}
