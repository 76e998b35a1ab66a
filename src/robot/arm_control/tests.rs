//! The law with ideal joints.

use super::*;
use crate::accommodation::Accommodation;
use crate::testing::{self, puma};

const DT: f64 = 1e-3;

fn control(limit: WrenchLimit) -> (ArmControl, Joints) {
    let q = testing::posture(6);
    let servo = Servo::new(0.01, 0.5, 2.0).unwrap();
    let accommodation = Accommodation::new([0.001; 6], [0.0; 6]).unwrap();
    let interaction = Interaction { accommodation, ..Interaction::default() };
    (ArmControl::new(testing::law(puma(), 50.0), servo, interaction, limit, &q), q)
}

/// Follows a command with ideal joints for `cycles` periods.
fn followed(
    control: &mut ArmControl,
    q: &mut Joints,
    command: &Motion,
    reading: &Wrench,
    cycles: u32,
) {
    for _ in 0..cycles {
        *q += control.step(DT, command, q, reading) * DT;
    }
}

#[test]
fn pose_is_reached_and_kept() {
    let (mut control, mut q) = control(WrenchLimit::NONE);
    let x_b_d =
        control.pose() * Isometry3::new([0.05, -0.03, -0.08].into(), [0.2, -0.1, 0.3].into());
    followed(&mut control, &mut q, &Motion::Pose(x_b_d), &Wrench::ZERO, 2_000);
    let off = control.pose().inverse() * x_b_d;
    assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6, "{off}");
}

#[test]
fn held_rate_yields_to_a_push() {
    let (mut control, mut q) = control(WrenchLimit::NONE);
    let push = Wrench::from_components([0.0, 0.0, -20.0, 0.0, 0.0, 0.0]);
    let rate = Motion::Rate(Twist::from_components([0.0, 0.0, 0.02, 0.0, 0.0, 0.0]));
    let before = *control.pose();
    followed(&mut control, &mut q, &rate, &push, 1_000);
    let moved = before.inverse() * control.pose();
    assert!(moved.translation.vector.norm() < 1e-6, "{moved}");
}

#[test]
fn wrench_above_the_limit_stops_until_reset() {
    let (mut control, mut q) = control(WrenchLimit { force: 50.0, moment: 5.0 });
    let rate = Motion::Rate(Twist::from_components([0.0, 0.0, 0.05, 0.0, 0.0, 0.0]));
    followed(&mut control, &mut q, &rate, &Wrench::ZERO, 200);
    let push = Wrench::from_components([0.0, 0.0, -60.0, 0.0, 0.0, 0.0]);
    followed(&mut control, &mut q, &rate, &push, 1);
    assert!(control.is_stopped());
    let stopped_at = *control.pose();
    followed(&mut control, &mut q, &rate, &Wrench::ZERO, 1_000);
    let rest = control.step(DT, &rate, &q, &Wrench::ZERO);
    assert!(rest.norm() < 1e-6, "{rest}");
    let off = stopped_at.inverse() * control.pose();
    assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6, "{off}");
    control.reset();
    assert!(control.step(DT, &rate, &q, &Wrench::ZERO).norm() > 0.0);
}

/// Returns a push on the tool against its approach, in N.
fn push(force: f64) -> Wrench {
    Wrench::from_components([0.0, 0.0, -force, 0.0, 0.0, 0.0])
}

#[test]
fn arm_reset_above_its_limit_moves_out_but_not_in() {
    let limit = WrenchLimit { force: 50.0, moment: 5.0 };
    let rate = |speed| Motion::Rate(Twist::from_components([0.0, 0.0, speed, 0.0, 0.0, 0.0]));
    let stopped = || {
        let (mut control, mut q) = control(limit);
        followed(&mut control, &mut q, &rate(0.05), &push(60.0), 10);
        assert!(control.is_stopped());
        control.reset();
        (control, q)
    };
    let (mut inwards, mut q) = stopped();
    for force in [60.0, 61.0, 62.0, 62.9] {
        followed(&mut inwards, &mut q, &rate(0.05), &push(force), 1);
        assert!(!inwards.is_stopped(), "within 5 %");
    }
    followed(&mut inwards, &mut q, &rate(0.05), &push(63.1), 1);
    assert!(inwards.is_stopped());

    let (mut outwards, mut q) = stopped();
    let before = *outwards.pose();
    for force in (0..=20).map(|step| 60.0 - f64::from(step)) {
        followed(&mut outwards, &mut q, &rate(-0.05), &push(force), 10);
        assert!(!outwards.is_stopped(), "{force} N");
    }
    assert!((before.inverse() * outwards.pose()).translation.z < -0.005);
    followed(&mut outwards, &mut q, &rate(0.05), &push(50.1), 1);
    assert!(outwards.is_stopped(), "the limit is full again");
}

#[test]
fn wrench_that_fell_after_a_reset_rises_by_5_percent_only() {
    let (mut control, mut q) = control(WrenchLimit { force: 50.0, moment: 5.0 });
    for force in [80.0, 80.0, 60.0] {
        followed(&mut control, &mut q, &Motion::Hold, &push(force), 1);
        if force >= 80.0 {
            control.reset();
        }
    }
    assert!(!control.is_stopped());
    followed(&mut control, &mut q, &Motion::Hold, &push(64.0), 1);
    assert!(control.is_stopped());
}

#[test]
fn reset_above_the_force_limit_keeps_that_of_the_moment() {
    let (mut control, mut q) = control(WrenchLimit { force: 50.0, moment: 5.0 });
    followed(&mut control, &mut q, &Motion::Hold, &push(60.0), 1);
    control.reset();
    let turning = Wrench::from_components([0.0, 0.0, -60.0, 5.1, 0.0, 0.0]);
    followed(&mut control, &mut q, &Motion::Hold, &turning, 1);
    assert!(control.is_stopped());
}

#[test]
fn invalid_measurements_stop_the_arm() {
    for (part, reading) in [(f64::NAN, 0.0), (0.0, f64::NAN)] {
        let (mut control, mut q) = control(WrenchLimit::NONE);
        q[2] += part;
        let reading = Wrench::from_components([reading; 6]);
        let rate = Motion::Rate(Twist::from_components([0.1; 6]));
        assert_eq!(control.step(DT, &rate, &q, &reading), Joints::zeros());
        assert!(control.is_stopped());
    }
}
