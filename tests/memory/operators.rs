//! Operator presets and surfaces with friction, in the whole loop on the in-memory bus.
#![allow(
    clippy::float_cmp,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::path::Path;

use nalgebra::Vector3;

use config::Config;
use lab::bench::Bench;
use sim::scenario::Scenario;
use telemetry::summary::Summary;

const FILE: &str = "config/kraft_like.toml";
const CONFIG: &str = include_str!("../../config/kraft_like.toml");
const CONTACT: &str = include_str!("../../config/scenarios/contact_10s.toml");

/// Returns the contact scenario with another target of its first move, and with these lines added.
fn going(to_m: &str, more: &str) -> Scenario {
    let script = CONTACT.replacen("to_m = [0.045, 0.0, 0.0]", &format!("to_m = {to_m}"), 1);
    assert_ne!(script, CONTACT, "the first move goes along x");
    Scenario::parse(&format!("{script}\n{more}")).unwrap()
}

/// Runs the first six seconds of a scenario; calls `felt` with each reflected force at the grip, in {0}.
fn summary(config: &str, scenario: Scenario, mut felt: impl FnMut(Vector3<f64>)) -> Summary {
    let config = Config::parse(Path::new(FILE), config).unwrap();
    let mut bench = Bench::new(&config, scenario, 1, false, ());
    bench.bring_up().unwrap();
    let mut summary = Summary::default();
    for _ in 0..6_000 {
        let record = bench.cycle();
        summary.add(&record);
        felt(record.output.x_0_g.rotation * record.output.f_g_task.force);
    }
    bench.stop().unwrap();
    summary
}

#[test]
fn every_operator_preset_feels_the_wall_without_a_stop() {
    let felt = ["relaxed", "firm", "nervous"].map(|preset| {
        let hand = format!("[hand]\npreset = \"{preset}\"\n");
        let summary = summary(CONFIG, going("[0.08, 0.0, 0.0]", &hand), |_| {});
        assert_eq!(summary.missing_samples, 0, "{preset}: {summary}");
        assert_eq!(summary.stopped_by, None, "{preset}");
        assert!(summary.contact_seconds > 0.5, "{preset}: {summary}");
        summary.peak_felt_force_n
    });
    let [relaxed, firm, _] = felt;
    assert!(relaxed < 0.8 * firm, "a compliant hand presses less: {relaxed} N and {firm} N");
}

#[test]
fn friction_of_a_rough_wall_opposes_sliding() {
    let rough = CONFIG.replacen("[remote.wall]", "[remote.wall]\nfriction = 0.8", 1);
    let sideways = "[0.05, 0.03, 0.0]";
    let mut strongest = 0.0_f64;
    summary(&rough, going(sideways, ""), |f_0| {
        let along = f_0.yz().norm();
        assert!(along <= 0.8 * f_0.x.abs() + 1e-3, "{f_0}");
        strongest = strongest.max(-f_0.y);
    });
    assert!(strongest > 0.3, "only {strongest} N against the motion");
    let mut smooth = 0.0_f64;
    summary(CONFIG, going(sideways, ""), |f_0| smooth = smooth.max(f_0.yz().norm()));
    assert!(smooth < 0.1 * strongest, "without friction {smooth} N");
}
