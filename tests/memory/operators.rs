//! Operator presets and surfaces with friction, in the complete control loop on the in-memory bus.

use nalgebra::Vector3;

use crate::common::prelude::*;
use controller::assist::ContactFade;
use controller::{Extensions, Settings};
use telemetry::summary::Summary;

const CONTACT: &str = include_str!("../../config/scenarios/contact_10s.toml");

/// Returns the contact scenario with another target of its first move, and with these lines added.
fn going(to_m: &str, more: &str) -> Scenario {
    let text = CONTACT.replacen("to_m = [0.045, 0.0, 0.0]", &format!("to_m = {to_m}"), 1);
    assert_ne!(text, CONTACT, "the first move goes along x");
    script(&format!("{text}\n{more}"))
}

/// Runs the first six seconds of a scenario; calls `on_force` with each reflected force on the grip, in {0}.
fn summary(config: &str, scenario: Scenario, mut on_force: impl FnMut(Vector3<f64>)) -> Summary {
    let config = parse(KRAFT, config);
    let mut bench = started(&config, scenario, ());
    let mut summary = Summary::default();
    for _ in 0..6_000 {
        let record = bench.cycle();
        summary.add(&record);
        on_force(record.output.x_0_g.rotation * record.output.f_g_task.force);
    }
    bench.shut_down().unwrap();
    summary
}

#[test]
fn every_operator_preset_feels_the_wall_without_a_stop() {
    let felt = ["relaxed", "firm", "nervous"].map(|preset| {
        let hand = format!("[hand]\npreset = \"{preset}\"\n");
        let summary = summary(KRAFT_TEXT, going("[0.08, 0.0, 0.0]", &hand), |_| {});
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
    let rough = KRAFT_TEXT.replacen("[remote.wall]", "[remote.wall]\nfriction = 0.8", 1);
    let sideways = "[0.05, 0.03, 0.0]";
    let mut strongest = 0.0_f64;
    summary(&rough, going(sideways, ""), |f_0| {
        let along = f_0.yz().norm();
        assert!(along <= 0.8 * f_0.x.abs() + 1e-3, "{f_0}");
        strongest = strongest.max(-f_0.y);
    });
    assert!(strongest > 0.3, "only {strongest} N against the motion");
    let mut smooth = 0.0_f64;
    summary(KRAFT_TEXT, going(sideways, ""), |f_0| smooth = smooth.max(f_0.yz().norm()));
    assert!(smooth < 0.1 * strongest, "without friction {smooth} N");
}

/// Pose mode without a wall: the hand moves forward by 14 cm, and returns from 5.5 s on, within 0.4 s.
const WITHDRAWAL: &str = "seconds = 7\n[[console]]\nat_s = 0.3\nrequest = \"mode pose\"\n\
    [[console]]\nat_s = 0.4\nrequest = \"arm\"\n[[switch]]\nat_s = 2.2\ndeadman = true\n\
    [[move]]\nat_s = 3.5\nduration_s = 1.5\nto_m = [0.14, 0.0, 0.0]\n\
    [[move]]\nat_s = 5.5\nduration_s = 0.4\nto_m = [0.0, 0.0, 0.0]\n";

const REFLECTION: &str =
    "[[switch]]\nat_s = 2.5\nreflection = true\n[[switch]]\nat_s = 2.6\nreflection = false\n";

/// Returns the peak speed of the grip in m/s, and the cause of a stop, with K_D in N·s/m and lines of the scenario.
fn withdrawn(damping: &str, more: &str) -> (f64, Option<String>) {
    let text = KRAFT_TEXT.replacen("point_m = [0.47,", "point_m = [0.9,", 1);
    let text = text.replacen("[8.0, 8.0, 8.0]", &format!("[{damping}, {damping}, {damping}]"), 1);
    let config = parse(KRAFT, &text);
    let mut bench = started(&config, script(&format!("{WITHDRAWAL}{more}")), ());
    let mut fastest = 0.0_f64;
    let mut cause = None;
    while bench.elapsed().as_secs_f64() < 6.5 {
        let record = bench.cycle();
        fastest = fastest.max(record.output.twist.v_g_raw.linear.norm());
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

/// Forces in rate mode, in N: of the task and of the return to centre at the grip as they act, and at the hand in the
/// simulation's own truth.
struct InContact {
    task: f64,
    back: f64,
    hand: f64,
}

impl InContact {
    fn new(bench: &Bench<()>, record: &Record) -> Self {
        let output = &record.output;
        let j_g = output.j_g.matrix().transpose();
        let f_g = j_g.lu().solve(&output.ledger.centring).unwrap();
        Self {
            task: output.f_g_task.force.norm(),
            back: f_g.fixed_rows::<3>(0).norm(),
            hand: bench.world().plant().f_g_hand().force.norm(),
        }
    }
}

/// Returns the forces in free motion, in contact and in harder contact; with another task force F0 that halves the return.
fn in_rate_mode(name: &str, fade: Option<Option<f64>>) -> [InContact; 3] {
    let mut config = config(&format!("config/{name}.toml"));
    if let Some(f0) = fade {
        let contact_fade = f0.map(|f0| ContactFade::new(f0).unwrap());
        let extensions = Extensions { contact_fade, ..config.controller.extensions };
        config = config.clone().with_controller(Settings { extensions, ..config.controller });
    }
    let mut bench = Bench::new(&config, script(CONTACT), 1, ());
    bench.bring_up().unwrap();
    [3.3, 6.4, 8.4].map(|seconds| {
        loop {
            let record = bench.cycle();
            if bench.elapsed().as_secs_f64() > seconds {
                return InContact::new(&bench, &record);
            }
        }
    })
}

#[test]
fn task_dominates_the_return_to_centre_in_rate_mode() {
    // Two axes of sixr_spherical return with 2.9 N: faded faster, the force on the hand would fall as contact grows.
    for (name, least) in [
        ("kraft_like", 2.5),
        ("kraft_like_500hz", 2.5),
        ("jpl_like", 2.5),
        ("sixr_spherical", 0.95),
    ] {
        let [free, contact, harder] = in_rate_mode(name, None);
        assert!(free.back > 1.9, "{name}: {} N back to the centre", free.back);
        for InContact { task, back, .. } in [contact, harder] {
            assert!(task > 1.5 && task > least * back, "{name}: {task} N, and {back} N back");
        }
    }
}

/// Prints the table of docs/haptics.md, "Rate mode: the task dominates".
#[test]
fn a_stronger_fade_returns_less_and_lets_the_hand_press_more() {
    for name in ["kraft_like", "kraft_like_500hz", "jpl_like", "sixr_spherical"] {
        let forces = [None, Some(2.0), Some(1.3), Some(1.0)].map(|f0| {
            let [_, InContact { task, back, hand }, _] = in_rate_mode(name, Some(f0));
            println!("{name}, F0 {f0:?}: task {task:.2}, return {back:.2}, hand {hand:.2} N");
            [task, back]
        });
        for pair in forces.windows(2) {
            assert!(pair[1][0] >= pair[0][0] - 0.01, "{name}: {forces:?}");
            assert!(pair[1][1] <= pair[0][1] + 0.01, "{name}: {forces:?}");
        }
    }
}

#[test]
fn hand_feels_more_in_harder_contact_in_every_direction() {
    for name in ["kraft_like", "kraft_like_500hz", "jpl_like", "sixr_spherical"] {
        let config = config(&format!("config/{name}.toml"));
        let fade = config.controller.extensions.contact_fade.unwrap();
        let [x, y, z, ..] = config.controller.channels.plateaus();
        for [a, b, c] in [[1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 1.0], [0.3, 0.0, 1.0]] {
            let push: Vector3<f64> = Vector3::new(a, b, c).normalize();
            // Every axis that is displaced returns with its whole plateau.
            let signs = push.map(|part| if part == 0.0 { 0.0 } else { part.signum() });
            let force = -Vector3::new(x, y, z).component_mul(&signs);
            let f_g_centring = Wrench { force, ..Wrench::ZERO };
            let felt = (0..1_000).map(|step| {
                let task = 1e-2 * f64::from(step);
                let f_g_task = Wrench { force: -push * task, ..Wrench::ZERO };
                let share = fade.share(&f_g_task, &f_g_centring);
                task - share * f_g_centring.force.dot(&push)
            });
            let felt: Vec<f64> = felt.collect();
            assert!(felt.windows(2).all(|pair| pair[1] >= pair[0] - 1e-12), "{name}, {push}");
        }
    }
}
