//! Stability check of the gains: bounds against independent values (`tests/oracles/stability.json`), device model
//! against the simulated arm, and refusal of every kind of unstable gain.
#![cfg(test)]

use std::fs;
use std::path::Path;
use std::process::Command;

use nalgebra::{Isometry3, Vector3};
use serde_json::Value;

use crate::common::cli::frhc;
use crate::common::oracle::{self, list, number};
use config::Config;
use controller::JointVector;
use controller::stability::axis::{Axis, AxisGains, Impedance, Timing};
use controller::stability::bounds::{self, RateReflection};
use controller::stability::device::{Device, JointResistance};
use controller::stability::finding::Verdict;
use controller::stability::grip_dynamics::ReducedGrip;
use controller::stability::passivity::{Law, SampledLaw};
use controller::stability::sampled_loop::{Loop, SampledLoop};
use remote::Remote;
use remote::scene::{Scene, Surface, Wall};
use remote::site::VirtualSite;
use robot::accommodation::Accommodation;
use sim::plant::{Plant, Resistance};
use testbench::world;
use units::spatial::{Motion, Twist, Wrench};
use units::time::Instant;

const FILE: &str = "config/kraft_like.toml";
const TEXT: &str = include_str!("../../config/kraft_like.toml");
const SHIPPED: [&str; 5] = [
    FILE,
    "config/kraft_like_500hz.toml",
    "config/jpl_like.toml",
    "config/jpl_like_1538hz.toml",
    "config/sixr_spherical.toml",
];

/// Asserts equality within the error of a supremum on a grid.
#[track_caller]
fn assert_close(value: f64, reference: f64) {
    assert!((value - reference).abs() <= 1e-6 * reference.abs(), "{value}, not {reference}");
}

fn cases(key: &str) -> Vec<Value> {
    list(&oracle::oracle("stability.json")[key]["cases"]).to_vec()
}

fn wall(case: &Value) -> SampledLaw {
    let or_zero = |key: &str| case.get(key).map_or(0.0, number);
    let law = Law::Impedance {
        stiffness: number(&case["K"]),
        damping: or_zero("B"),
        filter: or_zero("tau"),
    };
    let delay = case.get("delay_samples").and_then(Value::as_u64).unwrap_or(0);
    SampledLaw { law, period: number(&case["T"]), lag: 0.0, delay: u32::try_from(delay).unwrap() }
}

fn reflection(case: &Value) -> RateReflection {
    let [k_t, k_v, k_fa, k_e] = ["K_T", "K_V", "K_FA", "k_e"].map(|key| number(&case[key]));
    RateReflection { gain: k_t * k_v * k_e, yield_rate: k_fa * k_e }
}

#[test]
fn virtual_walls_need_the_damping_of_colgate_and_schenkel() {
    for key in ["virtual_wall", "spring_with_delay", "wall_filtered_velocity"] {
        for case in cases(key) {
            assert_close(wall(&case).required_damping(), number(&case["b_required_numeric"]));
        }
    }
}

#[test]
fn quantisation_bounds_stiffness_as_in_abbott_and_okamura() {
    for case in cases("quantisation") {
        let [b, period, friction, quantum] =
            ["b", "T", "fc", "Delta"].map(|key| number(&case[key]));
        let max = bounds::max_passive_stiffness(b, period, friction, quantum);
        assert_close(max, number(&case["K_max"]));
    }
}

#[test]
fn centring_has_the_expected_slope_and_rest_offset() {
    for case in cases("cfrtc_sampling") {
        let [a, deadband, period] = ["a", "DB", "T"].map(|key| number(&case[key]));
        let plateau = a * deadband * deadband;
        let slope = bounds::max_centring_stiffness(plateau, deadband);
        assert_close(slope, number(&case["K_max"]));
        let law = SampledLaw::impedance(slope, 0.0, period);
        assert_close(law.required_damping(), number(&case["b_required"]));
        let rest = bounds::rest_offset(plateau, deadband, 1.0);
        assert_close(rest, number(&case["rest_offset_for_Fc_1N"]));
    }
}

#[test]
fn rate_reflection_needs_the_damping_of_its_formula() {
    for case in cases("rate_mode_reflection_continuous") {
        let required = reflection(&case).required_damping(0.0, 0);
        assert_close(required, number(&case["b_required_numeric"]));
    }
    for case in cases("rate_mode_reflection_sampled") {
        let (reflection, period) = (reflection(&case), number(&case["T"]));
        let RateReflection { gain, yield_rate } = reflection;
        let law = Law::Rate { gain, yield_rate };
        for delay in 0..3 {
            let late = SampledLaw { law, period, lag: 0.0, delay };
            assert_close(late.required_damping(), reflection.required_damping(period, delay));
        }
        let required = reflection.required_damping(period, 0);
        assert_close(required, number(&case["b_required_formula"]));
        assert_close(required, number(&case["b_required_numeric"]));
    }
}

/// An axis at a period that is short against any motion of a hand.
const AXIS: Axis = Axis {
    name: "x",
    is_rotation: false,
    device: Device {
        mass: 1.0,
        damping: 0.0,
        friction: 0.0,
        full_friction: 0.0,
        compensated_stiffness: 0.0,
        quantum: 1e-5,
    },
    hand: Impedance { stiffness: 0.0, damping: 0.0 },
    environment: Impedance { stiffness: 0.0, damping: 0.0 },
    coupling: None,
    yielded_inertia: 0.0,
    tank_damping: 0.0,
    passivity_damping: 0.0,
    gains: AxisGains {
        rate: 0.0,
        pose: 0.0,
        wrench: 0.0,
        damping: 0.0,
        deadband: 0.0,
        plateau: 0.0,
        accommodation: 0.0,
    },
    timing: Timing {
        period: 1e-4,
        torque_delay: 1,
        pose_delay: 3,
        rate_delay: 2,
        accommodation_delay: 0,
        link_cycles: 0,
        is_robot: false,
        servo_lag: 0.0,
        velocity_filter: 0.0,
    },
    is_watched: false,
};

/// The sampled loop at a period that is short against its motion is the continuous one.
#[test]
fn held_rate_reflection_is_stable_by_the_routh_criterion() {
    for case in cases("rate_mode_routh") {
        let [mass, stiffness, damping] = ["M", "K_h", "b"].map(|key| number(&case[key]));
        let [wrench, rate, accommodation, k_e] =
            ["K_T", "K_V", "K_FA", "k_e"].map(|key| number(&case[key]));
        let axis = Axis {
            gains: AxisGains { wrench, rate, accommodation, ..AxisGains::default() },
            environment: Impedance { stiffness: k_e, damping: 0.0 },
            ..AXIS
        };
        let grip = ReducedGrip { mass, damping, stiffness, sampled_damping: 0.0 };
        let sampled = SampledLoop { axis: &axis, grip, link_cycles: 0 };
        let [open, reflected] = sampled.characteristic(Loop::Rate);
        let is_stable = open.plus(&reflected, 1.0).is_stable();
        assert_eq!(is_stable, case["routh_stable"].as_bool().unwrap(), "{case}");
        assert_eq!(is_stable, number(&case["max_real_root"]) < 0.0);
    }
}

#[test]
fn contact_settles_up_to_the_bound_only() {
    let (dt, gain) = (0.002, 0.002);
    let law = Accommodation::new([gain; 6], [0.0; 6]).unwrap();
    for late in [0_usize, 1, 2, 3] {
        let bound = bounds::max_yield_rate(dt, u32::try_from(late).unwrap()) / gain;
        for (stiffness, settles) in [(0.98 * bound, true), (1.02 * bound, false)] {
            let mut x = vec![1e-3; late + 1];
            for _ in 0..4_000 {
                let felt = x[x.len() - 1 - late];
                let f_m = Wrench::from_components([-stiffness * felt, 0.0, 0.0, 0.0, 0.0, 0.0]);
                let next = x[x.len() - 1] + law.rate(&Twist::ZERO, &f_m).linear.x * dt;
                x.push(next);
            }
            assert_eq!(x[x.len() - 1].abs() < 1e-3, settles, "{late} late, {stiffness} N/m");
        }
    }
}

#[test]
fn accommodation_bound_depends_on_the_delay() {
    for case in list(&oracle::oracle("ntrfc.json")["stability_bound"]["cases"]) {
        let delay = u32::try_from(case["delay_samples"].as_u64().unwrap()).unwrap();
        let period = 2e-3;
        assert_close(bounds::max_yield_rate(period, delay) * period, number(&case["numeric"]));
    }
}

/// A posture without aligned axes.
const POSTURE: [f64; 6] = [0.2, -0.8, 1.5, -0.6, 0.3, 0.4];

/// Returns the device model of the shipped configuration, and the simulated arm with changed friction.
fn device_and_plant(change: impl Fn(&mut Resistance)) -> ([Device; 6], Plant, JointVector, Config) {
    let weightless = TEXT.replace("[arm]\n", "[arm]\ngravity_balanced = true\n");
    assert_ne!(weightless, TEXT);
    let config = Config::parse(Path::new(FILE), &weightless).unwrap();
    let q = JointVector::from(POSTURE);
    let resistance = config.joints.each_ref().map(|joint| {
        let (coulomb, viscous) = (joint.plant.friction.coulomb, joint.plant.friction.viscous);
        let mut resistance =
            Resistance { coulomb, stiction: 0.0, viscous, range: joint.plant.link.range };
        change(&mut resistance);
        resistance
    });
    let joints = resistance.map(|Resistance { coulomb, viscous, .. }| JointResistance {
        coulomb,
        viscous,
        quantum: 1e-5,
        compensated_stiffness: 0.0,
    });
    let device = Device::at_grip(&config.controller.arm, &joints, &q).unwrap();
    (device, Plant::new(world::arm(&config.plant()), resistance, q), q, config)
}

/// Returns the velocity along or about `axis` of the simulated grip, `dt` s after `force` began to act.
fn pushed(
    plant: &Plant,
    config: &Config,
    q: &JointVector,
    axis: usize,
    force: f64,
    dt: f64,
) -> f64 {
    let mut unit = [0.0; 6];
    unit[axis] = force;
    let arm = &config.controller.arm;
    let tau = arm.jacobian(&arm.posture(q)).torques(&Wrench::from_components(unit));
    let mut plant = *plant;
    plant.advance(dt, &tau, None);
    arm.jacobian(&arm.posture(plant.q())).twist(plant.qd()).components()[axis]
}

#[test]
fn push_accelerates_the_mass_at_the_grip() {
    let none = |resistance: &mut Resistance| (resistance.coulomb, resistance.viscous) = (0.0, 0.0);
    let (device, plant, q, config) = device_and_plant(none);
    for (axis, device) in device.iter().enumerate() {
        let (force, dt) = (1.0, 1e-4);
        let mass = force * dt / pushed(&plant, &config, &q, axis, force, dt);
        assert!((mass / device.mass - 1.0).abs() < 1e-4, "{axis}: {mass}, {device:?}");
    }
}

#[test]
fn slow_push_moves_against_the_damping_at_the_grip() {
    let syrup = |resistance: &mut Resistance| {
        (resistance.coulomb, resistance.viscous) = (0.0, resistance.viscous * 1e4);
    };
    let (device, plant, q, config) = device_and_plant(syrup);
    for (axis, device) in device.iter().enumerate() {
        let force = 0.1;
        let damping = force / pushed(&plant, &config, &q, axis, force, 0.1);
        assert!((damping / device.damping - 1.0).abs() < 1e-2, "{axis}: {damping}, {device:?}");
    }
}

#[test]
fn only_a_push_beyond_the_friction_moves_the_grip() {
    let (device, plant, q, config) = device_and_plant(|_| {});
    for (axis, Device { friction, full_friction, .. }) in device.iter().enumerate() {
        let speed = |force: f64| pushed(&plant, &config, &q, axis, force, 0.01).abs();
        assert!(speed(0.98 * friction) < 1e-9 && speed(1.02 * friction) > 1e-9, "axis {axis}");
        assert!(full_friction >= friction);
    }
}

#[test]
fn surfaces_resist_rotation_as_the_check_assumes() {
    let (stiffness, turn) = (2_000.0, 1e-3);
    let surface = Surface { stiffness, damping: 0.0, friction: 0.0 };
    let wall = Wall { point: Vector3::zeros(), normal: -Vector3::x_axis(), surface };
    let scene = Scene { wall: Some(wall), ..Scene::default() };
    // One whole face is inside the wall.
    let x_b_m = Isometry3::new(Vector3::new(-0.015, 0.0, 0.0), Vector3::new(0.0, turn, 0.0));
    let moment = scene.wrench(&x_b_m, &Twist::ZERO).moment;
    let config = Config::parse(Path::new(FILE), TEXT).unwrap();
    let turning = config
        .findings()
        .into_iter()
        .find(|finding| (finding.name, finding.axis) == ("pose reflection, quantum", "about y"));
    let felt = turning.unwrap().left.value; // K_T K_P k_e
    assert!((0.15 * moment.norm() / turn / felt - 1.0).abs() < 0.3, "{moment}, {felt}");
}

#[test]
fn contact_wrench_is_sensed_one_exchange_after_its_command() {
    let text = changed(&[("start_m = [0.4,", "start_m = [0.4499,")]); // 0.1 mm before the wall
    let config = Config::parse(Path::new(FILE), &text).unwrap();
    let mut site = VirtualSite::new(&config.remote, config.period);
    let x_b_d = Isometry3::translation(0.02, 0.0, 0.0) * *site.pose();
    let times = (1..4).map(|cycle| Instant::ZERO + config.period * cycle);
    let commands = [Motion::Hold, Motion::Pose(x_b_d), Motion::Pose(x_b_d)];
    let sensed =
        times.zip(commands).map(|(at, command)| site.exchange(at, &command.into()).unwrap().f_s);
    let forces: Vec<f64> = sensed.map(|f_s| f_s.force.norm()).collect();
    assert!(forces[1] < 1e-9 && forces[2] > 0.1, "{forces:?}");
}

#[test]
fn shipped_gains_are_not_refused() {
    for file in SHIPPED {
        let findings = Config::load(Path::new(file)).unwrap().findings();
        assert_eq!(findings.len(), 120, "{file}");
        assert!(findings.iter().all(|finding| finding.verdict < Verdict::Refuses), "{file}");
    }
}

/// Returns [`TEXT`] with `changes`, each a part of it and its replacement.
fn changed(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(TEXT.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    })
}

/// A virtual coupling too stiff to be stable.
const COUPLING: &str = "[controller.virtual_coupling]\nstiffness_n_per_m = [1e5, 1e3, 1e3]\n\
    stiffness_nm_per_rad = [1.0, 1.0, 1.0]\ndamping_ns_per_m = [0.0, 0.0, 0.0]\n\
    damping_nms_per_rad = [0.0, 0.0, 0.0]\n\n[remote]\n";

const WEAK_HAND: (&str, &str) = ("[safety]", "[operator]\nstiffness_n_per_m = 20.0\n\n[safety]");

#[test]
fn every_kind_of_unstable_gain_is_refused_with_its_reason() {
    for (changes, key, finding) in [
        (
            vec![("[0.3, 0.3, 0.3,", "[6.0, 6.0, 6.0,")],
            "controller.wrench_gain",
            "pose reflection, held",
        ),
        (
            vec![("stiffness_n_per_m = 2000.0", "stiffness_n_per_m = 50000.0")],
            "controller.wrench_gain",
            "pose reflection, held",
        ),
        (
            vec![("damping_nms_per_rad = [0.02,", "damping_nms_per_rad = [30.0,")],
            "controller.damping_nms_per_rad",
            "damping, held, about x",
        ),
        (
            vec![("centring_n = [2.0, 2.0, 2.0]", "centring_n = [2.0, 2.0, 0.05]")],
            "controller.centring_n",
            "return to centre, plateau, z",
        ),
        (
            vec![("centring_nm = [0.08, 0.08", "centring_nm = [0.08, 0.001")],
            "controller.centring_nm",
            "return to centre, plateau, about y",
        ),
        (
            vec![("deadband_m = [0.01,", "deadband_m = [0.0001,")],
            "controller.centring_n",
            "return to centre, held, x",
        ),
        (
            vec![WEAK_HAND, ("accommodation_m_per_ns = 0.01", "accommodation_m_per_ns = 0.0")],
            "remote.accommodation_m_per_ns",
            "rate reflection, held",
        ),
        (
            vec![("rate_gain_per_s = [2.0, 2.0", "rate_gain_per_s = [200.0, 2.0")],
            "controller.wrench_gain",
            "rate reflection, held, x",
        ),
        (
            vec![("accommodation_m_per_ns = 0.01", "accommodation_m_per_ns = 1.1")],
            "remote.accommodation_m_per_ns",
            "accommodation",
        ),
        (
            vec![("damping_ns_per_m = 20.0", "damping_ns_per_m = 3000.0")],
            "remote.accommodation_m_per_ns",
            "accommodation, damper",
        ),
        (
            vec![
                ("accommodation_rad_per_nms = 0.5", "accommodation_rad_per_nms = 999.0"),
                ("stiffness_n_per_m = 2000.0", "stiffness_n_per_m = 120000.0"),
            ],
            "remote.accommodation_rad_per_nms",
            "accommodation",
        ),
        (
            vec![("[remote]\n", COUPLING)],
            "controller.virtual_coupling.stiffness_n_per_m",
            "virtual coupling, held, x",
        ),
    ] {
        let text = changed(&changes);
        let refusal = Config::parse(Path::new(FILE), &text).map(|_| ()).unwrap_err().to_string();
        let (_, name) = key.rsplit_once('.').unwrap();
        let line = text.lines().position(|line| line.starts_with(&format!("{name} = "))).unwrap();
        let expected = format!("{FILE}:{}: {key}: {finding}", line + 1);
        let line = refusal.lines().find(|line| line.starts_with(&expected));
        let line = line.unwrap_or_else(|| panic!("{expected}: {refusal}"));
        assert!(line.matches(" = ").count() >= 2 && line.contains("must stay below"), "{line}");
    }
}

#[test]
fn unstable_gain_on_several_axes_is_one_error() {
    let text = changed(&[("[0.3, 0.3, 0.3,", "[2.7, 2.8, 2.8,")]);
    let refusal = Config::parse(Path::new(FILE), &text).map(|_| ()).unwrap_err().to_string();
    assert_eq!(refusal.lines().count(), 1, "{refusal}");
    assert!(
        refusal.contains("pose reflection, held, z: K_T K_P k_e = 5600 N/m must stay below K_T K_P k_e at ρ = 1 = "),
        "{refusal}"
    );
}

#[test]
fn gain_check_warn_accepts_unstable_gains() {
    let unstable = ("[0.3, 0.3, 0.3,", "[6.0, 0.3, 0.3,");
    let text = |check| changed(&[unstable, ("max_moment_nm = 2.0", check)]);
    let warn = text("max_moment_nm = 2.0\ngain_check = \"warn\"");
    let findings = Config::parse(Path::new(FILE), &warn).unwrap().findings();
    assert!(findings.iter().any(|finding| finding.verdict == Verdict::Refuses));
    let refuse = text("max_moment_nm = 2.0\ngain_check = \"refuse\"");
    assert!(Config::parse(Path::new(FILE), &refuse).is_err());
    let neither = text("max_moment_nm = 2.0\ngain_check = \"hope\"");
    let refusal = Config::parse(Path::new(FILE), &neither).map(|_| ()).unwrap_err().to_string();
    assert!(refusal.contains(
        "controller.gain_check: unknown value \"hope\"; expected \"refuse\" or \"warn\""
    ));
}

#[test]
fn negative_operator_impedance_is_refused() {
    for key in
        ["stiffness_n_per_m", "damping_ns_per_m", "stiffness_nm_per_rad", "damping_nms_per_rad"]
    {
        let text = changed(&[("[safety]", &format!("[operator]\n{key} = -1.0\n\n[safety]"))]);
        let refusal = Config::parse(Path::new(FILE), &text).map(|_| ()).unwrap_err().to_string();
        assert!(
            refusal.contains(&format!("operator.{key}: must be zero or above, got -1")),
            "{refusal}"
        );
    }
}

/// Runs `frhc check` on `text`; returns exit code, stdout and stderr.
fn checked(name: &str, text: &str, json: bool) -> (Option<i32>, String, String) {
    let root = env!("CARGO_MANIFEST_DIR");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&file, text.replace("../eds", &format!("{root}/eds"))).unwrap();
    let mut command = Command::new(crate::common::program());
    command.args(["check", "--config"]).arg(&file).args(json.then_some("--json"));
    let output = command.output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    (output.status.code(), out, err)
}

#[test]
fn check_prints_both_sides_of_every_inequality() {
    let (code, out, _) = checked("fit.toml", TEXT, false);
    assert_eq!(code, Some(0));
    let assert_printed = |verdict: &str, inequality: &str| {
        let line = out.lines().find(|line| line.contains(inequality)).unwrap();
        assert!(line.starts_with(&format!("gains {verdict}")), "{line}");
        assert!(line.contains(" must stay below "), "{line}");
    };
    assert_printed("warns", "damping, y: K_D = 8.00 N·s/m");
    assert_printed(
        "holds",
        "accommodation, servo, z: K_FA k_e τ_s = 0.200 must stay below 1/4 = 0.250",
    );
}

#[test]
fn check_json_has_every_finding() {
    let (code, out, _) = checked("json.toml", TEXT, true);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, list(&report["gains"]).len()), (Some(0), 120));
    for finding in list(&report["gains"]) {
        // An infinite side is null.
        let [left, right] =
            ["left", "right"].map(|side| finding[side]["value"].as_f64().unwrap_or(f64::INFINITY));
        assert_eq!(left < right, finding["verdict"] == "holds", "{finding}");
    }
}

#[test]
fn check_of_refused_gains_ends_with_3() {
    let text = changed(&[("[0.3, 0.3, 0.3,", "[6.0, 0.3, 0.3,")]);
    let (code, out, err) = checked("unfit.toml", &text, false);
    assert_eq!((code, out.as_str()), (Some(3), ""));
    let line = text.lines().position(|line| line.starts_with("wrench_gain")).unwrap() + 1;
    let expected = format!("unfit.toml:{line}: controller.wrench_gain: pose reflection, held, x: ");
    assert!(err.contains(&expected), "{err}");
}

/// Runs `stiff-wall` with a wall of `stiffness` N/m; returns exit code, verdict in JSON and stderr.
fn stiff_wall(name: &str, config: &Path, stiffness: &str) -> (i32, String, String) {
    let script = include_str!("../../config/scenarios/stiff-wall.toml");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.toml"));
    fs::write(&file, script.replace("30_000.0", stiffness)).unwrap();
    let [config, file] = [config, &file].map(|file| file.to_str().unwrap());
    let ended = frhc(&["demo", "--json", "--config", config, "--scenario", file]);
    let report: Value = serde_json::from_str(&ended.stdout).unwrap();
    (ended.code, report["verdict"].as_str().unwrap().to_owned(), ended.stderr)
}

#[test]
fn stiff_wall_fails_only_where_the_layer_does_not_bound() {
    for (stiffness, code, verdict) in [
        ("2_000.0", 0, "nothing-to-bound"),
        ("30_000.0", 0, "bounded"),
        ("80_000.0", 1, "not-bounded"),
    ] {
        let (ended, found, err) =
            stiff_wall(&format!("wall-{stiffness}"), Path::new(FILE), stiffness);
        assert_eq!((ended, &*found), (code, verdict), "{stiffness} N/m: {err}");
        let is_said = err.contains("the passivity layer does not bound this loop");
        assert_eq!(is_said, code == 1, "{err}");
    }
}

#[test]
fn stiff_wall_out_of_reach_is_said_to_be_not_met() {
    let root = env!("CARGO_MANIFEST_DIR");
    let far =
        changed(&[("point_m = [0.47,", "point_m = [0.8,"), ("../eds", &format!("{root}/eds"))]);
    let config = Path::new(env!("CARGO_TARGET_TMPDIR")).join("far-wall-config.toml");
    fs::write(&config, far).unwrap();
    let (code, verdict, err) = stiff_wall("far-wall", &config, "30_000.0");
    assert_eq!((code, &*verdict), (1, "wall-not-met"));
    assert!(err.contains("the wall was not met"), "{err}");
}

#[test]
fn stop_by_a_fast_hand_names_speed_limit_and_remedy() {
    let script = "seconds = 4\n[[console]]\nat_s = 0.3\nrequest = \"arm\"\n\
        [[move]]\nat_s = 2.5\nduration_s = 0.2\nto_m = [0.14, 0.0, 0.0]\n";
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fast-hand.toml");
    fs::write(&file, script).unwrap();
    let ended = frhc(&["demo", "--scenario", file.to_str().unwrap()]);
    assert_eq!(ended.code, 6, "{}", ended.stderr);
    let said =
        ended.stderr.lines().filter(|line| line.contains("safety.max_grip_speed_m_per_s = 1"));
    assert_eq!(said.count(), 1, "{}", ended.stderr);
}

#[test]
fn shipped_files_start_with_short_warnings() {
    for file in SHIPPED {
        let ended = frhc(&["demo", "--config", file, "--seconds", "1"]);
        assert_eq!(ended.code, 0, "{file}: {}", ended.stderr);
        assert!(ended.stderr.lines().count() <= 1, "{file}: {}", ended.stderr);
        assert!(ended.stderr.lines().all(|line| line.chars().count() <= 120), "{}", ended.stderr);
    }
}
