//! Single events of a controller: invalid inputs, switches, a displaced hand and saturation.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::common::prelude::*;
use crate::controller_steps::{
    Bench, DEADMAN, MAX_TORQUES, NEUTRAL, REFERENCE, UP, displaced, settings,
};
use controller::arm::{Arm, JointKind, Link};
use controller::switches::CommandMode;
use controller::{DriveTargets, InvalidValue};
use units::drive::PerMille;
#[test]
fn torques_rise_from_zero_where_targets_are_withdrawn() {
    let after = |held| {
        let mut bench = Bench::engaged(&config(KRAFT).controller, CommandMode::Rate);
        (0..2_000).for_each(|_| _ = bench.press(DEADMAN));
        bench.input.held = held;
        bench.press(DEADMAN).tau.norm()
    };
    let carried = after(None);
    let zeros = after(Some(DriveTargets::Sent([PerMille(0); 6])));
    assert!(
        (zeros - carried).abs() < 1e-3 * carried,
        "six zeros that were sent: {zeros} {carried}"
    );
    let withdrawn = after(Some(DriveTargets::Withdrawn));
    assert!(withdrawn < 0.5 * carried, "{withdrawn} {carried}");
}

#[test]
fn hazard_42_invalid_wrench_has_no_effect() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    for (part, fault) in [
        (f64::NAN, InvalidValue::WrenchNotFinite),
        (f64::NEG_INFINITY, InvalidValue::WrenchNotFinite),
        (1e6, InvalidValue::WrenchTooLarge),
    ] {
        bench.input.f_s = Wrench::from_components([0.0, part, 0.0, 0.0, 0.0, 0.0]);
        let output = bench.at(NEUTRAL);
        assert_eq!(output.invalid_value, Some(fault));
        assert!((output.tau - output.ledger.gravity).norm() < 1e-12);
    }
}

#[test]
fn invalid_object_pose_keeps_the_last_pose() {
    let mut bench = Bench::new(&settings(), CommandMode::Pose);
    bench.input.x_b_m = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let output = bench.press(DEADMAN);
    assert_eq!(output.invalid_value, Some(InvalidValue::ObjectPoseNotFinite));
    let Motion::Pose(x_b_d) = output.command else { panic!("{:?}", output.command) };
    assert!((x_b_d.translation.vector - Vector3::new(0.4, 0.0, 0.3)).norm() < 1e-12);
}

#[test]
fn displaced_hand_commands_no_rate_until_back_at_centre() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    bench.press(UP);
    bench.at(displaced(0.1));
    assert_eq!(bench.press(DEADMAN).command, Motion::Hold);
    assert_eq!(bench.at(displaced(0.12)).command, Motion::Hold);
    assert_eq!(bench.at(NEUTRAL).command, Motion::Rate(Twist::ZERO));
    let Motion::Rate(v_m) = bench.at(displaced(0.1)).command else { panic!("held") };
    assert!(v_m.linear.norm() > 0.0);
}

#[test]
fn hand_turned_past_80_degrees_holds_until_back_at_centre() {
    let mut settings = settings();
    // Five prismatic joints and one revolute joint that rotates the grip about y, the axis of β.
    settings.arm = {
        let links = [JointKind::Prismatic; 5].map(|kind| Link {
            kind,
            range: [-1.0, 1.0],
            ..Link::TURNING
        });
        let [a, b, c, d, e] = links;
        let alpha = -std::f64::consts::FRAC_PI_2; // its z axis is y of {0}
        let wrist = Link { kind: JointKind::Revolute, alpha, ..a };
        let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -alpha);
        let x_6_g = Isometry3::from_parts(Vector3::zeros().into(), upright);
        Arm::new([a, b, c, d, e, wrist], x_6_g, [0.0; 3]).unwrap()
    };
    let rotated = |degrees: f64| [0.0, 0.0, 0.0, 0.0, 0.0, degrees.to_radians()];
    let mut bench = Bench::new(&settings, CommandMode::Rate);
    bench.at(rotated(0.0));
    bench.press(REFERENCE);
    bench.press(DEADMAN);
    assert_eq!(bench.at(rotated(79.0)).invalid_value, None);
    for degrees in [81.0, 89.0, 95.0, 79.0] {
        let output = bench.at(rotated(degrees));
        assert_eq!(
            (output.command, output.invalid_value),
            (Motion::Hold, Some(InvalidValue::TurnedTooFar))
        );
    }
    assert_eq!(bench.at(rotated(0.0)).invalid_value, None);
    assert!(matches!(bench.at(rotated(20.0)).command, Motion::Rate(v_m) if v_m.angular.y > 0.1));
}

#[test]
fn first_deadman_press_sets_the_reference() {
    let mut bench = Bench::new(&settings(), CommandMode::Rate);
    bench.at(displaced(0.1));
    let output = bench.press(DEADMAN);
    assert!(output.reference.is_set);
    assert_eq!(output.command, Motion::Rate(Twist::ZERO));
}

#[test]
fn restart_suspends_damping_for_one_cycle() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    bench.input.restart = true;
    assert!(bench.at(displaced(0.2)).f_g_damping.force.norm() == 0.0);
    bench.input.restart = false;
    assert!(bench.at(displaced(0.201)).f_g_damping.force.norm() > 0.0);
}

#[test]
fn hazard_44_large_wrench_saturates_and_names_the_joint() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    bench.input.f_s = Wrench::from_components([300.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let output = bench.at(NEUTRAL);
    let joint = output.ledger.limiting_joint.unwrap().index();
    assert!(output.is_saturated() && output.ledger.rest_scale < 1.0);
    assert!((output.tau[joint].abs() - MAX_TORQUES[joint]).abs() < 1e-12);
}

#[test]
fn index_button_keeps_the_last_command_of_a_lagging_object() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Pose);
    let asked = bench.at(displaced(0.05)).command;
    assert!(asked != Motion::Pose(bench.input.x_b_m), "the object lags behind");
    bench.press(REFERENCE);
    for by in [0.05, 0.0, -0.05] {
        let (Motion::Pose(kept), Motion::Pose(asked)) = (bench.at(displaced(by)).command, asked)
        else {
            panic!("no pose commanded");
        };
        assert!((kept.to_homogeneous() - asked.to_homogeneous()).norm() < 1e-12);
    }
}
