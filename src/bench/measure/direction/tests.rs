use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Vector3};

use super::*;
use controller::arm::Link;
use units::numbering::Joint;

/// Six turning joints: z, then five about y in a chain of 0.2 m, but the last one about x.
fn arm() -> Arm<6> {
    let turning = Link { range: [-3.0, 3.0], ..Link::TURNING };
    let mut links = [Link { a: 0.2, ..turning }; 6];
    links[0] = turning;
    links[1] = Link { alpha: -FRAC_PI_2, ..turning };
    links[5] = Link { alpha: FRAC_PI_2, a: 0.0, ..turning };
    Arm::new(links, Isometry3::translation(0.1, 0.0, 0.0), [0.0, 0.0, -9.81]).unwrap()
}

/// Moves a joint by an angle, at 20 Hz, after a second at rest; returns what comes of it.
fn moved(
    direction: &mut Direction<'_>,
    at: &mut f64,
    q: &mut JointVector,
    by: &[(usize, f64)],
) -> Vec<Event> {
    let mut events = Vec::new();
    for step in 0..40 {
        *at += 0.05;
        if step >= 20 {
            by.iter().for_each(|(joint, by)| q[*joint] += by / 20.0);
        }
        events.extend(direction.take(*at, q));
    }
    events
}

#[test]
fn joint_that_turns_as_the_file_says_is_right_and_the_next_is_asked_for() {
    let arm = arm();
    let mut direction = Direction::new(&arm, Motion::all());
    let (mut at, mut q) = (0.0, JointVector::repeat(0.3));
    for joint in Joint::ALL {
        let motion = Motion::Joint(joint);
        let events = moved(&mut direction, &mut at, &mut q, &[(joint.index(), 0.09)]);
        assert_eq!(events, [Event::Ask(motion), Event::Answered(motion, Answer::Right)]);
    }
    assert_eq!(direction.left().next(), Some(Motion::Push(Axis::X)));
}

#[test]
fn contradiction_is_asked_for_once_more_and_unclear_motions_as_often_as_they_come() {
    let arm = arm();
    let first = Motion::Joint(Joint::of::<1>());
    let mut direction = Direction::new(&arm, [first]);
    let (mut at, mut q) = (0.0, JointVector::zeros());
    let reversed = Event::Answered(first, Answer::Reversed);
    assert_eq!(
        moved(&mut direction, &mut at, &mut q, &[(0, -0.09)]),
        [Event::Ask(first), reversed]
    );
    let unclear = Event::Answered(first, Answer::Unclear);
    for _ in 0..3 {
        let events = moved(&mut direction, &mut at, &mut q, &[(0, 0.09), (1, 0.09)]);
        assert_eq!(events, [Event::Ask(first), unclear]);
    }
    assert_eq!(
        moved(&mut direction, &mut at, &mut q, &[(0, -0.09)]),
        [Event::Ask(first), reversed]
    );
    let wrong = Event::Wrong(first, Answer::Reversed);
    assert_eq!(moved(&mut direction, &mut at, &mut q, &[(0, -0.09)]), [Event::Ask(first), wrong]);

    let mut direction = Direction::new(&arm, [first]);
    let other = Answer::OtherJoint(Joint::of::<3>());
    let events = moved(&mut direction, &mut at, &mut q, &[(2, 0.09)]);
    assert_eq!(events, [Event::Ask(first), Event::Answered(first, other)]);
    let events = moved(&mut direction, &mut at, &mut q, &[(0, 0.09)]);
    assert_eq!(events, [Event::Ask(first), Event::Answered(first, Answer::Right)]);
    assert_eq!(direction.take(at, &q), Some(Event::Done));
}

#[test]
fn grip_is_judged_along_and_about_the_axes_of_the_base() {
    let arm = arm();
    // The first joint turns the stretched grip about z, 0.9 m away: towards +y.
    let cases = [
        (Motion::Push(Axis::Y), 0.09, Answer::Right),
        (Motion::Push(Axis::Y), -0.09, Answer::OtherAxis(Axis::nearest(&-Vector3::y()))),
        (Motion::Push(Axis::X), 0.09, Answer::OtherAxis(Axis::Y)),
        (Motion::Turn(Axis::Z), 0.4, Answer::Right),
        (Motion::Turn(Axis::X), 0.4, Answer::OtherAxis(Axis::Z)),
    ];
    for (motion, by, answer) in cases {
        let mut direction = Direction::new(&arm, [motion]);
        let (mut at, mut q) = (0.0, JointVector::zeros());
        let events = moved(&mut direction, &mut at, &mut q, &[(0, by)]);
        assert_eq!(events[..2], [Event::Ask(motion), Event::Answered(motion, answer)]);
    }
    let mut direction = Direction::new(&arm, [Motion::Push(Axis::Y)]);
    let (mut at, mut q) = (0.0, JointVector::from([-0.6, 0.0, 0.0, 0.0, 0.0, 0.0]));
    let events = moved(&mut direction, &mut at, &mut q, &[(0, 0.09)]);
    assert_eq!(events[1], Event::Answered(Motion::Push(Axis::Y), Answer::Unclear));
}

#[test]
fn nothing_is_asked_while_the_arm_moves_or_a_position_is_unknown() {
    let arm = arm();
    let mut direction = Direction::new(&arm, Motion::all());
    let mut q = JointVector::zeros();
    for step in 0..100 {
        q[0] += 0.002;
        assert_eq!(direction.take(f64::from(step) * 0.05, &q), None);
    }
    q[0] = f64::NAN;
    for step in 100..200 {
        assert_eq!(direction.take(f64::from(step) * 0.05, &q), None);
    }
}
