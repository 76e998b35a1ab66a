//! The commanded side against the oracles: arms, payload, accommodation; and the shipped robot files.

use nalgebra::{Isometry3, Vector3};

use crate::common::oracle::{
    self, assert_near, assert_same_pose, list, number, numbers, pose, rows, twist, vector, wrench,
};
use crate::common::prelude::*;
use crate::common::refusals::with_value;
use config::robots::RobotArm;
use robot::accommodation::Accommodation;
use robot::chain::Joints;
use robot::following_arm::FollowingArm;
use robot::interaction::Interaction;
use robot::object::{Object, Servo};
use robot::payload::{Payload, SensorMotion};
use units::spatial::rotation as rotations;

const DT: f64 = 1e-3;

const ARMS: [&str; 2] = [PUMA, "config/robots/eight_r_synthetic.toml"];

fn arm(file: &str) -> RobotArm {
    RobotArm::load(Path::new(file)).unwrap()
}

#[test]
fn shipped_puma_matches_the_reference() {
    let arm = arm(PUMA);
    for config in list(&oracle::oracle("puma560_corke_mdh.json")["configs"]) {
        let mut q = Joints::zeros();
        q.as_mut_slice()[..6].copy_from_slice(&numbers::<6>(&config["q"]));
        let (x_b_m, j_m) = arm.law().chain().forward_and_jacobian(&q);
        let x_0_w = arm.x_b_0.inverse() * x_b_m * arm.x_n_m.inverse();
        assert_same_pose("puma", &x_0_w, &pose(&config["T_0W"]));
        let reference = rows::<6, 6>(&config["J_body_W"]);
        for (joint, (linear, angular)) in
            j_m.linear.column_iter().zip(j_m.angular.column_iter()).take(6).enumerate()
        {
            let v_m = Twist { linear: linear.into(), angular: angular.into() };
            let expected = reference.map(|row| row[joint]);
            assert_near("Jacobian", &v_m.at(&arm.x_n_m).components(), &expected);
        }
    }
}

#[test]
fn arms_start_where_the_free_object_does() {
    let config = config(KRAFT);
    for file in ARMS {
        let arm = arm(file);
        let off = config.remote.x_b_m.inverse() * arm.following().pose();
        assert!(off.translation.vector.norm() < 1e-5, "{file}: {off}");
        assert!(off.rotation.angle() < 1e-5, "{file}: {off}");
        assert!(arm.following().sigma_min() > 0.3, "{file}");
    }
}

#[test]
fn payload_is_compensated() {
    let paper = oracle::oracle("paper.json");
    let (inputs, payload) = (&paper["inputs"], &paper["inputs"]["payload"]);
    let gravity = vector(&oracle::oracle("sixr_spherical.json")["model"]["g0"]);
    let inertia = rows::<3, 3>(&payload["I_cg_S"]);
    let removed = Payload::new(number(&payload["mass"]), numbers(&payload["r_cg_S"])).unwrap();
    let [[xx, xy, xz], [_, yy, yz], [.., zz]] = inertia;
    let removed = removed.with_inertia([xx, yy, zz, xy, xz, yz]).unwrap();
    let r_b_s = rotations::from_euler_zyx(&vector(&payload["R_0S_euler_zyx_gba"]));
    let x_b_s = Isometry3::from_parts(Vector3::zeros().into(), r_b_s);
    let weight = removed.weight(&x_b_s, &gravity);
    assert_near(
        "weight",
        &weight.components(),
        &numbers::<6>(&paper["payload"]["weight_wrench_S"]),
    );

    // The oracle names the acceleration of the centre of mass; a sensor at rest at this moment moves so.
    let (omega, alpha) = (vector(&payload["omega_S"]), vector(&payload["alpha_S"]));
    let r = vector(&payload["r_cg_S"]);
    let a_s = r_b_s.inverse() * vector(&payload["a_cg_0"])
        - alpha.cross(&r)
        - omega.cross(&omega.cross(&r));
    let moving = SensorMotion {
        v_s: Twist { linear: Vector3::zeros(), angular: omega },
        v_dot_s: Twist { linear: a_s, angular: alpha },
    };
    let load = removed.load(&x_b_s, &gravity, &moving);
    let reference = &paper["payload"]["weight_plus_inertia_wrench_S"];
    assert_near("load", &load.components(), &numbers::<6>(reference));

    let servo = Servo::new(0.01, 1.0, 1.0).unwrap();
    let interaction =
        Interaction { payload: removed, gravity_in_b: gravity, ..Interaction::default() };
    let object = Object::new(servo, x_b_s).with_interaction(interaction);
    let f_s = object.operator_wrench(&wrench(&inputs["F_S_meas"]));
    let reference = &paper["payload"]["F_S_after_static_removal"];
    assert_near("contact", &f_s.components(), &numbers::<6>(reference));
}

#[test]
fn rate_control_becomes_force_control_in_contact() {
    let ntrfc = oracle::oracle("ntrfc.json");
    let sim = &ntrfc["sim_no_delay"];
    let [k_v, k_fa, k_e, dx_db, dt] =
        ["K_V", "K_FA", "k_e", "dX_db", "T"].map(|key| number(&sim[key]));
    let servo = Servo::new(0.0, 100.0, 100.0).unwrap();
    let start = Isometry3::translation(number(&sim["x0"]), 0.0, 0.0);
    let law = Accommodation::new([k_fa; 6], [0.0; 6]).unwrap();
    let interaction = Interaction { accommodation: law, ..Interaction::default() };
    let mut object = Object::new(servo, start).with_interaction(interaction);
    let v_m = Twist::from_components([k_v * dx_db, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let column = |key: &str| list(&sim[key]).iter().map(number).collect::<Vec<_>>();
    let mut last = 0.0;
    for ((x, force), speed) in column("x").into_iter().zip(column("F")).zip(column("v")) {
        let here = object.pose().translation.x;
        last = -k_e * (here - number(&sim["x_wall"])).max(0.0);
        let f_m = Wrench::from_components([last, 0.0, 0.0, 0.0, 0.0, 0.0]);
        object.step(dt, &Motion::Rate(v_m), &f_m);
        assert_near("x, F", &[here, last], &[x, force]);
        assert_near("v", &[object.twist().linear.x], &[speed]);
    }
    assert!((last - number(&sim["expected_final_F"])).abs() < 1e-6);
}

#[test]
fn the_equilibrium_of_accommodation() {
    let ntrfc = oracle::oracle("ntrfc.json");
    let equilibrium = &ntrfc["equilibrium"];
    let law = Accommodation::new(numbers(&equilibrium["K_FA"]), [0.0; 6]).unwrap();
    let rate = twist(&equilibrium["dX_db"]).scaled(&numbers(&equilibrium["K_V"]));
    let f_m = -wrench(&equilibrium["wrench_exerted_on_environment"]);
    assert_near("at rest", &law.rate(&rate, &f_m).components(), &[0.0; 6]);
}

/// Presses an arm against a spring along z of {MRF} with a constant rate command; returns the wrench at rest, and that
/// of the law.
fn pressed(file: &str, k_e: f64, k_fa: f64, v: f64, servo_lag: f64) -> (f64, f64) {
    let law = Accommodation::new([k_fa; 6], [0.0; 6]).unwrap();
    let following: FollowingArm = arm(file).following();
    let servo = Servo::new(servo_lag, 0.5, 2.0).unwrap();
    let interaction = Interaction { accommodation: law, ..Interaction::default() };
    let mut object =
        Object::new(servo, following.pose()).with_interaction(interaction).held_by(following);
    let start = *object.pose();
    let v_m = Twist::from_components([0.0, 0.0, v, 0.0, 0.0, 0.0]);
    let mut force = 0.0;
    for _ in 0..4_000 {
        let depth = (start.inverse() * object.pose()).translation.z - 0.01;
        force = -k_e * depth.max(0.0);
        let f_m = Wrench::from_components([0.0, 0.0, force, 0.0, 0.0, 0.0]);
        object.step(DT, &Motion::Rate(v_m), &f_m);
    }
    (-force, v / k_fa)
}

#[test]
fn held_rate_becomes_the_force_of_the_law_on_both_arms() {
    for file in ARMS {
        let (force, expected) = pressed(file, 10_000.0, 0.002, 0.02, 0.01);
        assert!((force / expected - 1.0).abs() < 0.01, "{file}: {force} N, law {expected} N");
    }
}

/// Returns the messages for the robot file `text`, named by a configuration, with their file names shortened.
fn refused(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.toml");
    fs::write(&file, text).unwrap();
    let refusal = refusal(KRAFT, &with_robot(file.to_str().unwrap()));
    refusal.replace(folder.path().to_str().unwrap(), "")
}

/// Returns the text of kraft_like with a robot in place of the free object.
fn with_robot(file: &str) -> String {
    let robot = format!("robot = \"{file}\"");
    let held = [("start_m = [0.4, 0.0, 0.3]", &*robot), ("start_deg = [90.0, 0.0, 90.0]", "")];
    changed(KRAFT_TEXT, &held)
}

#[test]
fn invalid_robot_files_are_refused_by_key() {
    for (key, value, expected) in [
        ("joint[1].start_deg", "230.0", "must be within limit_deg, -45 to 225"),
        ("joint[1].limit_deg", "[225.0, -45.0]", "must rise"),
        ("joint[0].max_rate_deg_per_s", "0.0", "must be above"),
        ("resolved_rate.length_m", "0.0", "must be within 0.01..=100"),
        ("resolved_rate.lengths_m", "0.5", "unknown key"),
        ("joint[1].mass_kg", "nan", "must be within"),
        ("joint[1].rotor_inertia_kg_m2", "9e18", "must be within 0.000001..=10000, got"),
        ("joint[1].viscous_friction_nms_per_rad", "1e300", "must be within 0..=10000, got"),
        ("joint[1].coulomb_friction_nm", "1e300", "must be within 0..=10000, got"),
        ("joint[1].max_torque_nm", "1e300", "must be within 0.001..=1000000, got"),
    ] {
        let (text, line) = with_value(&text(PUMA), key, value);
        let message = refused(&text);
        let expected = format!("/arm.toml:{line}: {key}: {expected}");
        assert!(message.contains(&expected), "{key} = {value}: {message}");
        assert!(message.contains("remote.robot: /arm.toml is not usable"), "{message}");
    }
    let unnamed = refused(&changed(&text(PUMA), &[("name = \"PUMA 560\"", "")]));
    assert!(
        unnamed.contains("/arm.toml:") && unnamed.contains("missing field `name`"),
        "{unnamed}"
    );
    assert!(unnamed.contains("remote.robot: /arm.toml is not usable"), "{unnamed}");
}

#[test]
fn robot_and_start_contradict_each_other() {
    let text = fs::read_to_string(KRAFT).unwrap();
    let text = text.replacen(
        "kind = \"virtual\"",
        "kind = \"virtual\"\nrobot = \"robots/puma560.toml\"",
        1,
    );
    let invalid = refusal(KRAFT, &text);
    assert!(invalid.contains("remote.start_m: contradicts remote.robot"), "{invalid}");
    let missing = with_robot("robots/absent.toml");
    let invalid = refusal(KRAFT, &missing);
    assert!(invalid.contains("config/robots/absent.toml"), "{invalid}");
}

#[test]
fn arm_plays_the_contact_scenario_like_the_free_object() {
    for file in ["robots/puma560.toml", "robots/eight_r_synthetic.toml"] {
        let (config, free) = (parse(KRAFT, &with_robot(file)), config(KRAFT));
        let played = |config: &Config| {
            let text = fs::read_to_string("config/scenarios/contact_10s.toml").unwrap();
            let mut bench = Bench::new(config, script(&text), 1, ());
            bench.bring_up().unwrap();
            let mut poses = Vec::new();
            for _ in 0..10_000 {
                let record = bench.cycle();
                poses.push((record.x_b_m, record.f_s));
            }
            poses
        };
        let (held, free) = (played(&config), played(&free));
        let most = held
            .iter()
            .zip(&free)
            .map(|((a, _), (b, _))| (a.translation.vector - b.translation.vector).norm());
        let most = most.fold(0.0, f64::max);
        let felt = held.iter().map(|(_, f_s)| f_s.force.norm()).fold(0.0, f64::max);
        assert!(most < 1e-3, "{file}: {most} m from the free object");
        assert!(felt > 2.0, "{file}: {felt} N");
    }
}
