//! Arms other than the default one: balanced with a prismatic joint, with a spherical wrist and an offset grip, and
//! with coupled actuators.

use nalgebra::SVector;

use crate::common::oracle;
use crate::common::prelude::*;
use telemetry::summary::Summary;
use units::drive::{Counts, PerMille};

const CONTACT: &str = include_str!("../../config/scenarios/contact_10s.toml");

/// The default arm with the elbow's motor on the base, behind a parallelogram.
fn coupled() -> Config {
    let text = fs::read_to_string(KRAFT).unwrap();
    let coupling = "[coupling]\nmatrix = [\n    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],\n    \
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],\n    [0.0, -1.0, 1.0, 0.0, 0.0, 0.0],\n    \
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],\n    [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],\n    \
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],\n]\noffset_rad_or_m = [0.0, 0.0, 0.3, 0.0, 0.0, 0.0]\n\n";
    let text = text.replacen("[switches]", &format!("{coupling}[switches]"), 1);
    parse(KRAFT, &text)
}

/// Runs ten seconds of contact, calls `look` with every record, and returns the summary.
fn contact(config: &Config, mut look: impl FnMut(&Record)) -> Summary {
    let mut bench = started(config, script(CONTACT), ());
    let mut summary = Summary::default();
    for _ in 0..10_000 {
        let record = bench.cycle();
        look(&record);
        summary.add(&record);
    }
    assert_eq!(bench.node().mode(), Mode::Armed, "{:?}", bench.node().cause());
    summary
}

/// Asserts contact, reflected force, and no missing sample.
fn assert_felt(summary: &Summary) {
    assert_eq!(summary.missing_samples, 0);
    assert!(summary.contact_seconds > 1.5, "{summary}");
    assert!(summary.peak_felt_force_n > 0.9, "{summary}");
}

#[test]
fn balanced_arm_with_a_prismatic_joint_feels_the_wall() {
    let config = config(JPL);
    let summary = contact(&config, |record| {
        assert!(record.output.ledger.gravity.norm() == 0.0, "a balanced arm has no gravity torque");
        let slide = record.output.q[2];
        assert!((0.25..=0.6).contains(&slide), "prismatic joint at {slide} m");
    });
    assert_felt(&summary);
}

#[test]
fn arm_with_the_grip_off_the_wrist_feels_the_wall() {
    assert_felt(&contact(&config(SIXR), |_| ()));
}

#[test]
fn coupled_actuators_exert_the_joint_torques() {
    let config = coupled();
    let arm = world::arm(&config.plant());
    let mut compared = 0;
    let summary = contact(&config, |record| {
        if record.mode != Mode::Armed && record.mode != Mode::Engaged {
            return;
        }
        compared += 1;
        let tau = record.output.tau;
        // The matrix C maps actuator to joint positions: tau_a = Cᵀ tau.
        let tau_a = [tau[0], tau[1] - tau[2], tau[2], tau[3], tau[4], tau[5]];
        for ((joint, torque), target) in config.joints.iter().zip(tau_a).zip(record.targets) {
            let [c1, c3, c5] = joint.plant.actuator.torque_curve;
            let curve = c1 * torque + c3 * torque.powi(3) + c5 * torque.powi(5);
            let expected = curve * joint.plant.actuator.gear_ratio.signum();
            assert!((expected - f64::from(target)).abs() <= 0.5 + 1e-6, "{}", joint.name);
        }
        // The simulation computes gravity independently of the controller.
        let posture = arm.posture(&SVector::from(record.output.q));
        let carried = arm.gravity(&posture);
        let full = record.at.since(Instant::ZERO).as_secs_f64() > 3.0;
        assert!(!full || (carried - record.output.ledger.gravity).norm() < 1e-9);
    });
    assert!(compared > 5_000);
    assert_felt(&summary);
}

#[test]
fn coupled_counts_and_torques_round_trip() {
    let calibration = coupled().controller.calibration;
    let q = SVector::from([0.1, -0.7, 1.5, -0.7, 0.05, 0.2]);
    let again = calibration.positions(&calibration.counts(&q));
    assert!((again - q).norm() < 1e-4);
    let targets = calibration.targets(&SVector::from([0.5, -2.0, 1.1, 0.2, -0.1, 0.05]));
    let back = calibration.torques(&targets);
    assert!((back - SVector::from([0.5, -2.0, 1.1, 0.2, -0.1, 0.05])).norm() < 0.02);
    assert_ne!(targets, [PerMille(0); 6]);
    assert_ne!(calibration.counts(&q), [Counts(0); 6]);
}

#[test]
fn shipped_arms_match_the_oracles() {
    for name in ["kraft_like", "jpl_like", "sixr_spherical"] {
        let (ours, reference) =
            (config(&format!("config/{name}.toml")).controller.arm, oracle::arm(name));
        for case in oracle::list(&oracle::oracle(&format!("{name}.json"))["configs"]) {
            let q = oracle::joints(&case["q"]);
            let (posture, expected) = (ours.posture(&q), reference.posture(&q));
            oracle::assert_same_pose(name, &posture.x_0_g, &expected.x_0_g);
            let mass = [ours.mass_matrix(&posture), reference.mass_matrix(&expected)];
            oracle::assert_near(name, mass[0].as_slice(), mass[1].as_slice());
            let down = [0.0, 0.0, -9.81];
            let weight = ours.in_gravity(down).unwrap().gravity(&posture);
            oracle::assert_near(name, weight.as_slice(), reference.gravity(&expected).as_slice());
        }
    }
}

/// Asserts that the arm stays where the hand releases it; returns the last record.
fn stays_when_released(config: &Config) -> Record {
    let release = "seconds = 4\n[[console]]\nat_s = 0.3\nrequest = \"arm\"\n\
        [[hold]]\nat_s = 1.8\nholding = false\n";
    let mut bench = Bench::new(config, script(release), 1, ());
    bench.bring_up().unwrap();
    bench.run(1_900);
    let released = *bench.world_mut().plant().q();
    bench.run(2_000);
    let record = bench.cycle();
    let q = *bench.world_mut().plant().q();
    assert!((q - released).amax() < 2e-3, "it sank from {released} to {q}");
    assert_eq!(record.mode, Mode::Armed);
    record
}

#[test]
fn released_arm_stays_in_place() {
    stays_when_released(&config(SIXR));
    stays_when_released(&coupled());
}

#[test]
fn released_balanced_arm_stays_in_place_at_zero_torque() {
    assert_eq!(stays_when_released(&config(JPL)).targets, [0; 6]);
}

#[test]
fn grip_and_object_start_with_equal_orientation() {
    for name in [KRAFT, JPL, SIXR] {
        let config = config(name);
        let x_0_g = config.controller.arm.forward(&world::start(&config.plant()));
        let angle = x_0_g.rotation.angle_to(&config.remote.x_b_m.rotation);
        assert!(angle < 1e-5, "{name}: {angle} rad apart");
    }
}
