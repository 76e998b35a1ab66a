//! Straight lines and turns of the shipped arms, as kinematic models (mode 1), against the free object.
//!
//! The limits are the same as long as neither side reaches its own: those of the servo, and those of the joints, which
//! the free object does not have. A course ends where the arm reaches one, or a singular value of 0.05.

use crate::common::prelude::*;
use config::robots::RobotArm;
use robot::following_arm::FollowingArm;
use robot::joint_limits::JointLimits;
use robot::object::{Object, Servo};

const DT: f64 = 1e-3;

/// Duration of a ramp from rest to full speed, in cycles.
const RAMP: u32 = 250;

/// Duration of the outward motion, and of the return motion, in cycles.
const LEG: u32 = 2_500;

/// Speed of a line in m/s, and of a turn in rad/s.
const SPEEDS: [f64; 2] = [0.1, 0.4];

/// Smallest singular value down to which the arm is compared, lengths over 0.5 m.
const SIGMA_MIN: f64 = 0.05;

/// Shortest course to compare, in m or rad; some end at a limit of a joint.
const MIN_LENGTH: f64 = 0.15;

/// Deviation of one course from the free object.
#[derive(Clone, Copy, Debug, Default)]
struct Course {
    /// Largest distance, in m.
    distance: f64,
    /// Largest angle, in rad.
    angle: f64,
    /// Length that was compared, in m or rad.
    length: f64,
}

/// Returns the speed in a cycle as a share of full speed: ramp up, constant, ramp down, then the same in reverse.
fn share(cycle: u32) -> f64 {
    let (cycle, sign) = if cycle < LEG { (cycle, 1.0) } else { (cycle - LEG, -1.0) };
    let ramp = |cycles: u32| (f64::from(cycles) / f64::from(RAMP)).min(1.0);
    sign * ramp(cycle).min(ramp(LEG - cycle))
}

/// Returns whether a joint is at its maximum rate or acceleration, or so near to an end that it must brake.
fn is_limited(limits: &JointLimits, before: &FollowingArm, after: &FollowingArm) -> bool {
    let rates = before.qd().iter().zip(after.qd()).zip(after.q());
    limits.joints().iter().zip(rates).any(|(limit, ((before, rate), q))| {
        let braking = rate.abs() * DT + rate.powi(2) / (2.0 * limit.max_acceleration);
        let [low, high] = limit.range;
        rate.abs() > 0.999 * limit.max_rate
            || (rate - before).abs() > 0.999 * limit.max_acceleration * DT
            || q - braking < low + 0.01
            || q + braking > high - 0.01
    })
}

/// Commands a line or turn along `axis` of {MRF} to both; compares poses as long as the arm can follow.
fn course(
    arm: FollowingArm,
    limits: &JointLimits,
    servo: Servo,
    axis: usize,
    sign: f64,
    is_pose: bool,
) -> Course {
    let mut held = Object::new(servo, arm.pose()).held_by(arm);
    // The joints that are left over come to rest first.
    for _ in 0..5_000 {
        held.step(DT, &Motion::Rate(Twist::ZERO), &Wrench::ZERO);
    }
    let start = *held.pose();
    let mut free = Object::new(servo, start);
    let speed = sign * SPEEDS[axis / 3];
    let mut line = [0.0; 6];
    let (mut way, mut course) = (0.0, Course::default());
    for cycle in 0..2 * LEG {
        let rate = speed * share(cycle);
        way += rate * DT;
        line[axis] = if is_pose { way } else { rate };
        let command = if is_pose {
            Motion::Pose(start * Twist::from_components(line).over(1.0))
        } else {
            Motion::Rate(Twist::from_components(line))
        };
        let before = *held.arm().unwrap();
        held.step(DT, &command, &Wrench::ZERO);
        free.step(DT, &command, &Wrench::ZERO);
        let after = held.arm().unwrap();
        if after.sigma_min() <= SIGMA_MIN || is_limited(limits, &before, after) {
            break;
        }
        let off = free.pose().inverse() * held.pose();
        course.distance = course.distance.max(off.translation.vector.norm());
        course.angle = course.angle.max(off.rotation.angle());
        course.length += (rate * DT).abs();
    }
    course
}

#[test]
fn shipped_arms_follow_lines_and_turns_as_the_free_object() {
    let servo = config(KRAFT).remote.servo;
    for file in [PUMA, "config/robots/eight_r_synthetic.toml"] {
        let arm = RobotArm::load(Path::new(file)).unwrap();
        for axis in 0..6 {
            for (sign, is_pose) in [(1.0, false), (-1.0, false), (1.0, true), (-1.0, true)] {
                let found = course(arm.following(), arm.law().limits(), servo, axis, sign, is_pose);
                assert!(found.length > MIN_LENGTH, "{file}, axis {axis}: {found:?}");
                assert!(found.distance < 1e-3, "{file}, axis {axis}: {found:?}");
                assert!(found.angle < 0.5_f64.to_radians(), "{file}, axis {axis}: {found:?}");
            }
        }
    }
}
