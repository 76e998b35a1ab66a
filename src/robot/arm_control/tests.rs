//! Tests of the law with ideal joints.

use nalgebra::{Point3, Vector3};

use super::*;
use crate::accommodation::Accommodation;
use crate::testing::{self, puma};

const DT: f64 = 1e-3;

fn control(limit: WrenchLimit) -> (ArmControl, Joints) {
    yielding(limit, 0.001)
}

/// Returns an arm with this accommodation on all axes, in m/(s·N) and rad/(s·N·m).
fn yielding(limit: WrenchLimit, gain: f64) -> (ArmControl, Joints) {
    let q = testing::posture(6);
    let servo = Servo::new(0.01, 0.5, 2.0).unwrap();
    let accommodation = Accommodation::new([gain; 6], [0.0; 6]).unwrap();
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

/// Plane of 4 kN/m, normal to the initial approach of the tool, in contact with one point of the tool at the start.
struct Plane {
    x_b_m: Isometry3<f64>,
    /// Point in {MRF}, in m.
    point: Point3<f64>,
}

/// Stiffness, in N/m.
const STIFFNESS: f64 = 4_000.0;

impl Plane {
    /// Returns the wrench on the tool, at {MRF} in {MRF}.
    fn wrench(&self, x_b_m: &Isometry3<f64>) -> Wrench {
        let moved = self.x_b_m.inverse() * x_b_m;
        let depth = ((moved * self.point).z - self.point.z).max(0.0);
        let force = moved.rotation.inverse() * Vector3::new(0.0, 0.0, -STIFFNESS * depth);
        Wrench { force, moment: self.point.coords.cross(&force) }
    }
}

/// Arm in contact, in closed loop.
struct ContactLoop {
    control: ArmControl,
    q: Joints,
    plane: Plane,
}

impl ContactLoop {
    /// Presses until the limit of 50 N or 5 N·m stops the arm.
    fn new(gain: f64, point: [f64; 3]) -> Self {
        let (control, q) = yielding(WrenchLimit { force: 50.0, moment: 5.0 }, gain);
        let plane = Plane { x_b_m: *control.pose(), point: point.into() };
        let mut contact = Self { control, q, plane };
        while !contact.control.is_stopped() {
            contact.run(&INWARDS, 1);
        }
        contact.run(&INWARDS, 200);
        contact
    }

    /// Follows a command for `cycles`; returns the maximum force, in N.
    fn run(&mut self, command: &Motion, cycles: u32) -> f64 {
        let forces = (0..cycles).map(|_| {
            let reading = self.plane.wrench(self.control.pose());
            followed(&mut self.control, &mut self.q, command, &reading, 1);
            reading.force.norm()
        });
        forces.fold(0.0, f64::max)
    }

    /// Follows a command between resets; returns the force before them and the maximum one, in N.
    fn reset_often(&mut self, command: &Motion) -> [f64; 2] {
        let before = self.run(&Motion::Hold, 1);
        let resets = (0..25).map(|_| {
            self.control.reset();
            self.run(command, 100)
        });
        [before, resets.fold(0.0, f64::max)]
    }
}

/// Rate of 0.3 m/s into the plane: accommodation of 0.001 m/(s·N) cancels it at 300 N.
const INWARDS: Motion = rate([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]);

const fn rate(components: [f64; 6]) -> Motion {
    Motion::Rate(Twist::from_components(components))
}

#[test]
fn repeated_resets_do_not_raise_the_wrench() {
    let (tip, beside) = ([0.0; 3], [0.04, 0.0, 0.0]);
    // About y of {MRF}: the offset point penetrates, with a moment within the limit.
    let turning = rate([0.0, 0.0, 0.0, 0.0, -1.0, 0.0]);
    let oblique = rate([0.1, -0.05, 0.3, 0.2, -0.5, 0.3]);
    let straight = [(tip, INWARDS), (beside, INWARDS)];
    let turned = [(beside, turning), (beside, oblique)];
    for gain in [0.0, 0.001] {
        for (point, command) in straight.into_iter().chain(turned) {
            let mut contact = ContactLoop::new(gain, point);
            let [before, greatest] = contact.reset_often(&command);
            assert!(before > 50.0, "stopped at {before} N");
            // An arm that has left may approach again once, and stops at its speed.
            assert!(greatest < 1.05 * before, "{gain}, {command:?}: {before} N, then {greatest} N");
        }
    }
}

#[test]
fn repeated_resets_do_not_raise_the_wrench_at_a_pose() {
    let mut contact = ContactLoop::new(0.0, [0.0; 3]);
    let deeper = Motion::Pose(contact.control.pose() * Isometry3::translation(0.01, 0.0, 0.1));
    let [before, greatest] = contact.reset_often(&deeper);
    assert!(greatest < before + 0.5, "{before} N, then {greatest} N");
}

#[test]
fn arm_reset_above_its_limit_moves_sideways_at_full_rate() {
    let mut contact = ContactLoop::new(0.0, [0.0; 3]);
    contact.control.reset();
    let before = *contact.control.pose();
    contact.run(&rate([0.05, 0.0, 0.3, 0.0, 0.0, 0.5]), 100);
    let moved = before.inverse() * contact.control.pose();
    assert!(!contact.control.is_stopped());
    // Less the effect of the acceleration limits.
    let (way, turn) = (moved.translation.x, moved.rotation.angle());
    assert!((0.0044..0.0051).contains(&way), "{way} m");
    assert!((0.044..0.051).contains(&turn), "{turn} rad");
}

#[test]
fn arm_reset_above_its_limit_yields_against_an_inward_command() {
    let mut contact = ContactLoop::new(0.001, [0.0; 3]);
    contact.control.reset();
    // The arm leaves at 0.05 m/s until the limit applies again, with the inward command.
    let before = contact.run(&Motion::Hold, 1);
    contact.run(&INWARDS, 10);
    let after = contact.plane.wrench(contact.control.pose()).force.norm();
    assert!(after < before - 1.0, "{before} N, then {after} N");
}
