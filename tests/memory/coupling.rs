//! Virtual coupling in pose mode: the object stops at surfaces, and the hand feels what they carry. Felt forces are those
//! of the simulation: of its motors, and of its hand.

use crate::common::prelude::*;
use crate::common::refusals::are_refused;
use controller::JointVector;

/// 5 kN/m and 20 N·m/rad.
const SECTION: &str = "[controller.virtual_coupling]\nstiffness_n_per_m = [5000.0, 5000.0, 5000.0]\n\
    stiffness_nm_per_rad = [20.0, 20.0, 20.0]\ndamping_ns_per_m = [10.0, 10.0, 10.0]\n\
    damping_nms_per_rad = [0.04, 0.04, 0.04]\n\n[remote]\n";

/// Pose mode: the hand moves by `TO` and rests there from 6 s on.
const PRESS: &str = "seconds = 9\n[[console]]\nat_s = 0.3\nrequest = \"mode pose\"\n\
    [[console]]\nat_s = 0.4\nrequest = \"arm\"\n[[switch]]\nat_s = 2.2\ndeadman = true\n\
    [[switch]]\nat_s = 2.5\nreflection = true\n[[switch]]\nat_s = 2.6\nreflection = false\n\
    [[move]]\nat_s = 4.0\nduration_s = 1.5\nto_m = TO\n";

/// Returns a shipped configuration with a wall and a nearer box of `stiffness` N/m, with `section` for `[remote]`.
fn text(name: &str, stiffness: f64, section: &str) -> String {
    let text = fs::read_to_string(format!("config/{name}.toml")).unwrap();
    let surface = format!("stiffness_n_per_m = {stiffness:.1}\ndamping");
    let text = text.replace("stiffness_n_per_m = 2000.0\ndamping", &surface);
    let text = text.replace("centre_m = [0.4, 0.25, 0.3]", "centre_m = [0.4, 0.12, 0.3]");
    text.replacen("[remote]\n", section, 1)
}

fn parsed(name: &str, text: &str) -> Config {
    parse(&format!("config/{name}.toml"), text)
}

fn config(name: &str, stiffness: f64, section: &str) -> Config {
    parsed(name, &text(name, stiffness, section))
}

/// Returns a bench after its boot, whose hand moves by `to`.
fn bench(config: &Config, to: [f64; 3]) -> Bench<()> {
    started(config, script(&PRESS.replace("TO", &format!("{to:?}"))), ())
}

fn run_until(bench: &mut Bench<()>, seconds: f64) {
    while bench.elapsed().as_secs_f64() < seconds {
        bench.cycle();
    }
}

/// Forces in still contact, in N: RMS of K_T times the contact, and of the differences from it.
#[derive(Debug)]
struct Still {
    wanted: f64,
    commanded: f64,
    motor: f64,
    hand: f64,
}

/// Presses with a hand that moves by `to`, and looks at the second from 7.5 s on.
fn pressed(config: &Config, to: [f64; 3]) -> Still {
    let mut bench = bench(config, to);
    run_until(&mut bench, 7.5);
    let arm = world::arm(&config.plant());
    let mut sums = [0.0; 4];
    let mut count = 0.0;
    while bench.elapsed().as_secs_f64() < 8.5 {
        let record = bench.cycle();
        assert_eq!(record.mode, Mode::Engaged, "{:?}", record.cause);
        let wanted = wanted(config, &record);
        let q = *bench.world_mut().plant().q();
        let posture = arm.posture(&q);
        let tau: JointVector = bench.world_mut().torques() - arm.gravity(&posture);
        let f = arm.jacobian(&posture).matrix().transpose().lu().solve(&tau).unwrap();
        let motor = Wrench::from_components(f.into());
        let hand = -*bench.world_mut().plant().f_g_hand();
        let commanded = record.output.f_g_task;
        for (sum, part) in sums.iter_mut().zip([
            wanted.force.norm_squared(),
            (commanded.force - wanted.force).norm_squared(),
            (motor.force - wanted.force).norm_squared(),
            (hand.force - wanted.force).norm_squared(),
        ]) {
            *sum += part;
        }
        count += 1.0;
    }
    let [wanted, commanded, motor, hand] = sums.map(|sum: f64| (sum / count).sqrt());
    Still { wanted, commanded, motor, hand }
}

/// Returns K_T times the wrench of the surface, at {G}.
fn wanted(config: &Config, record: &Record) -> Wrench {
    let f_m = record.f_s.at(&config.remote.interaction.sensor.x_m_s);
    f_m.scaled(config.controller.reflection.gain().values())
}

#[test]
fn motors_show_the_contact_of_the_coupled_object() {
    for name in ["jpl_like", "kraft_like"] {
        for stiffness in [2_000.0, 50_000.0] {
            // The motors exert the friction compensation, too.
            let text = text(name, stiffness, SECTION);
            let (before, friction) = text.split_once("[controller.friction]").unwrap();
            let (_, after) = friction.split_once("\n\n").unwrap();
            let still = pressed(&parsed(name, &format!("{before}{after}")), [0.08, 0.0, 0.0]);
            assert!(still.wanted > 5.0, "{name}, {stiffness} N/m: {still:?}");
            assert!(still.commanded < 2e-3 * still.wanted, "{name}, {stiffness} N/m: {still:?}");
            // kraft_like at 2 kN/m: 1.06 %.
            assert!(still.motor < 1.1e-2 * still.wanted, "{name}, {stiffness} N/m: {still:?}");
        }
    }
}

#[test]
fn hand_feels_the_contact_of_the_coupled_object() {
    for name in ["jpl_like", "kraft_like"] {
        for stiffness in [2_000.0, 50_000.0] {
            let still = pressed(&config(name, stiffness, SECTION), [0.08, 0.0, 0.0]);
            assert!(still.wanted > 5.0, "{name}, {stiffness} N/m: {still:?}");
            assert!(still.hand < 0.1 * still.wanted, "{name}, {stiffness} N/m: {still:?}");
        }
    }
}

#[test]
fn coupled_object_stops_at_wall_and_box() {
    for stiffness in [2_000.0, 50_000.0] {
        let config = config("kraft_like", stiffness, SECTION);
        for (to, axis, surface) in [([0.07, 0.0, 0.0], 0, 0.45), ([0.0, 0.085, 0.0], 1, 0.05)] {
            let mut bench = bench(&config, to);
            run_until(&mut bench, 7.0);
            let record = bench.cycle();
            let Motion::Pose(x_b_d) = record.output.command else { panic!("no pose command") };
            let [depth, commanded] =
                [record.x_b_m, x_b_d].map(|x| x.translation.vector[axis] - surface);
            let contact = record.f_s.force.norm();
            assert!(contact > 10.0 && (contact - stiffness * depth).abs() < 0.1, "{contact} N");
            let expected = commanded * 5_000.0 / (5_000.0 + stiffness);
            assert!((depth - expected).abs() < 1e-5, "{depth} m instead of {expected}");
        }
    }
}

#[test]
fn coupled_object_has_no_lag_of_its_servo_in_free_motion() {
    let mut bench = bench(&config("kraft_like", 2_000.0, SECTION), [-0.1, 0.0, 0.0]);
    let (mut fastest, mut most) = (0.0_f64, 0.0_f64);
    while bench.elapsed().as_secs_f64() < 7.0 {
        let output = bench.cycle().output;
        fastest = fastest.max(output.twist.v_g_raw.linear.norm());
        most = most.max(output.f_g_task.force.norm());
    }
    // A cycle of delay: K_T K_vc T = 1.5 N·s/m. The servo's 10 ms would make it 15.
    assert!(fastest > 0.1 && most < 2.0 * fastest, "{most} N at {fastest} m/s");
}

#[test]
fn coupling_to_an_object_that_no_surface_stops_is_refused() {
    let robot = text("kraft_like", 2_000.0, SECTION).replace("\"virtual\"", "\"robot\"");
    let line = robot.lines().position(|line| line == "[controller.virtual_coupling]").unwrap() + 1;
    let refused = refusal("robot.toml", &robot);
    let expected = format!(
        "robot.toml:{line}: controller.virtual_coupling: needs an object that surfaces stop"
    );
    assert!(refused.contains(&expected), "{refused}");
    assert!(refused.contains("remove the section"), "{refused}");
}

#[test]
fn coupling_with_a_stiffness_out_of_range_is_refused_by_key() {
    let key = "controller.virtual_coupling.stiffness_n_per_m";
    let rows = [
        (key, "[0.0, 5000.0, 5000.0]", "must be above zero, got 0"),
        (key, "[2e6, 5000.0, 5000.0]", "stiffness, x: 2000000 is not within 0 and 1000000"),
    ];
    are_refused("wrong.toml", &text("kraft_like", 2_000.0, SECTION), &rows);
}
