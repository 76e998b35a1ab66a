//! Stability check of the gains: bounds against independent values (`tests/oracles/stability.json`), device model
//! against the simulated arm, and refusal of every kind of unstable gain.

use nalgebra::{Isometry3, Vector3};

use crate::common::oracle::{self, list, number};
use crate::common::prelude::*;
use controller::JointVector;
use controller::stability::axis::{Axis, AxisGains, Impedance, Timing};
use controller::stability::bounds::{self, RateReflection};
use controller::stability::device::{Device, JointResistance};
use controller::stability::grip_dynamics::ReducedGrip;
use controller::stability::passivity::{Law, SampledLaw};
use controller::stability::sampled_loop::{Loop, SampledLoop};
use remote::Remote;
use remote::scene::{Scene, Surface, Wall};
use remote::site::VirtualSite;
use robot::accommodation::Accommodation;
use sim::plant::{Plant, Resistance};

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
    let weightless = KRAFT_TEXT.replace("[arm]\n", "[arm]\ngravity_balanced = true\n");
    assert_ne!(weightless, KRAFT_TEXT);
    let config = parse(KRAFT, &weightless);
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
    let config = parse(KRAFT, KRAFT_TEXT);
    let turning = config
        .findings()
        .into_iter()
        .find(|finding| (finding.name, finding.axis) == ("pose reflection, quantum", "about y"));
    let felt = turning.unwrap().left.value; // K_T K_P k_e
    assert!((0.15 * moment.norm() / turn / felt - 1.0).abs() < 0.3, "{moment}, {felt}");
}

#[test]
fn contact_wrench_is_sensed_one_exchange_after_its_command() {
    let text = changed(KRAFT_TEXT, &[("start_m = [0.4,", "start_m = [0.4499,")]); // 0.1 mm before the wall
    let config = parse(KRAFT, &text);
    let mut site = VirtualSite::new(&config.remote, config.period);
    let x_b_d = Isometry3::translation(0.02, 0.0, 0.0) * *site.pose();
    let times = (1..4).map(|cycle| Instant::ZERO + config.period * cycle);
    let commands = [Motion::Hold, Motion::Pose(x_b_d), Motion::Pose(x_b_d)];
    let sensed =
        times.zip(commands).map(|(at, command)| site.exchange(at, &command.into()).unwrap().f_s);
    let forces: Vec<f64> = sensed.map(|f_s| f_s.force.norm()).collect();
    assert!(forces[1] < 1e-9 && forces[2] > 0.1, "{forces:?}");
}
