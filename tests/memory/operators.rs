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
use controller::assist::ContactFade;
use lab::bench::Bench;
use node::record::Record;
use sim::scenario::Scenario;
use telemetry::summary::Summary;
use units::spatial::Wrench;

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

/// Pose mode without a wall: the hand goes forward by 14 cm, and comes back from 5.5 s on, within 0.4 s.
const WITHDRAWAL: &str = "seconds = 7\n[[console]]\nat_s = 0.3\nrequest = \"mode pose\"\n\
    [[console]]\nat_s = 0.4\nrequest = \"arm\"\n[[switch]]\nat_s = 2.2\ndeadman = true\n\
    [[move]]\nat_s = 3.5\nduration_s = 1.5\nto_m = [0.14, 0.0, 0.0]\n\
    [[move]]\nat_s = 5.5\nduration_s = 0.4\nto_m = [0.0, 0.0, 0.0]\n";

const REFLECTION: &str =
    "[[switch]]\nat_s = 2.5\nreflection = true\n[[switch]]\nat_s = 2.6\nreflection = false\n";

/// Returns the peak speed of the grip in m/s, and the cause of a stop, with K_D in N·s/m and lines of the scenario.
fn withdrawn(damping: &str, more: &str) -> (f64, Option<String>) {
    let text = CONFIG.replacen("point_m = [0.55,", "point_m = [0.9,", 1);
    let text = text.replacen("[8.0, 8.0, 8.0]", &format!("[{damping}, {damping}, {damping}]"), 1);
    let config = Config::parse(Path::new(FILE), &text).unwrap();
    let script = Scenario::parse(&format!("{WITHDRAWAL}{more}")).unwrap();
    let mut bench = Bench::new(&config, script, 1, false, ());
    bench.bring_up().unwrap();
    let mut fastest = 0.0_f64;
    let mut cause = None;
    while bench.elapsed().as_secs_f64() < 6.5 {
        let record = bench.cycle();
        fastest = fastest.max(record.output.moving.v_g_raw.linear.norm());
        cause = cause.or(record.cause.map(|cause| cause.to_string()));
    }
    (fastest, cause)
}

#[test]
fn fast_withdrawal_overshoots_its_script_by_the_hand_alone() {
    // The script is a minimum-jerk motion.
    let scripted = 1.875 * 0.14 / 0.4;
    let (without_damping, cause) = withdrawn("0.0", REFLECTION);
    assert!(without_damping > 1.5 * scripted, "{without_damping} m/s of {scripted} m/s");
    assert_eq!(cause.as_deref(), Some("grip speed above its limit"));
    // No gain acts without reflection, and the hand is as fast.
    let (off, cause) = withdrawn("8.0", "");
    assert!((off - without_damping).abs() < 0.02 * off, "{off} m/s and {without_damping} m/s");
    assert_eq!(cause.as_deref(), Some("grip speed above its limit"));
    // Damping of controller or hand keeps it below 1 m/s.
    let damped_hand = format!("{REFLECTION}[hand]\ndamping_ns_per_m = 25.0\n");
    for (fastest, cause) in [withdrawn("8.0", REFLECTION), withdrawn("0.0", &damped_hand)] {
        assert!(fastest < 1.0 && cause.is_none(), "{fastest} m/s, {cause:?}");
    }
}

/// Returns the force of the task and of the return to centre at the grip in N, the latter as it acts.
fn task_and_return(record: &Record) -> [f64; 2] {
    let output = &record.output;
    let j_g = output.j_g.matrix().transpose();
    let f_g = j_g.lu().solve(&output.ledger.centring).unwrap();
    [output.f_g_task.force.norm(), f_g.fixed_rows::<3>(0).norm()]
}

#[test]
fn task_dominates_the_return_to_centre_in_rate_mode() {
    for (name, least) in
        [("kraft_like", 2.5), ("kraft_like_500hz", 2.5), ("jpl_like", 2.5), ("sixr_spherical", 1.2)]
    {
        let config = Config::load(Path::new(&format!("config/{name}.toml"))).unwrap();
        let scenario = Scenario::parse(CONTACT).unwrap();
        let mut bench = Bench::new(&config, scenario, 1, false, ());
        bench.bring_up().unwrap();
        let mut at = |seconds: f64| loop {
            let record = bench.cycle();
            if bench.elapsed().as_secs_f64() > seconds {
                return task_and_return(&record);
            }
        };
        // Free motion, contact, and harder contact.
        let [_, free] = at(3.3);
        assert!(free > 1.9, "{name}: {free} N back to the centre");
        for seconds in [6.4, 8.4] {
            let [task, back] = at(seconds);
            assert!(task > 1.5 && task > least * back, "{name}: {task} N, and {back} N back");
        }
    }
}

#[test]
fn hand_feels_more_in_harder_contact() {
    let fade = ContactFade::new(1.3).unwrap();
    let plateau = 2.0;
    let felt = (0..1_000).map(|step| {
        let task = 1e-2 * f64::from(step);
        let f_g_task = Wrench { force: Vector3::new(-task, 0.0, 0.0), ..Wrench::ZERO };
        task + plateau * fade.share(&f_g_task)
    });
    let felt: Vec<f64> = felt.collect();
    assert!(felt.windows(2).all(|pair| pair[1] > pair[0]), "{felt:?}");
}
