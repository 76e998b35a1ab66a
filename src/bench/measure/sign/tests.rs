use std::path::Path;

use super::*;
use units::drive::{Counts, PerMille};

fn config() -> Config {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(3).unwrap();
    Config::load(&root.join("config/kraft_like.toml")).unwrap()
}

/// Posture of rest.
fn rest(config: &Config) -> JointVector {
    JointVector::from(config.joints.each_ref().map(|joint| joint.rest.unwrap().position()))
}

fn report(joint: Joint, answers: [(i16, i32); 2]) -> TrialReport {
    TrialReport {
        joint: joint.number(),
        bound: 400,
        state: "ended".to_owned(),
        end: Some("done".to_owned()),
        moved_instead: None,
        answers: answers.map(|(torque, counts)| Some(TrialAnswer { torque, counts })),
    }
}

#[test]
fn bounds_rise_to_the_most_that_a_joint_may_need() {
    let of =
        |weight, friction| bounds(&Breakaway { weight, centres: 0.0, friction, capacity: 10.0 });
    assert_eq!(of(0.0, 0.1), [40]);
    assert_eq!(of(-1.0, 0.1), [50, 100, 200]);
    assert_eq!(of(3.0, 0.1), [50, 100, 200, 400, 520]);
    assert!(of(0.0, 0.0).is_empty());
}

/// Judges these answers of a joint, of which each has a torque in ‰ of rated torque and a motion in counts.
fn judged(config: &Config, joint: Joint, answers: [(i16, i32); 2], is_last: bool) -> Verdict {
    let breakaway = breakaway(config, joint, &rest(config));
    judge(joint.entry(&config.joints), &breakaway, &report(joint, answers), is_last)
}

/// Returns the target for a torque of a joint, in N·m or N.
fn target(config: &Config, joint: Joint, torque: f64) -> i16 {
    let mut tau = JointVector::zeros();
    tau[joint.index()] = torque;
    let PerMille(target) = *joint.entry(&config.controller.calibration.targets(&tau));
    target
}

#[test]
fn motion_against_the_torque_is_reversed_in_either_direction() {
    let (config, joint) = (config(), Joint::of::<3>());
    let judged = |answers| judged(&config, joint, answers, false);
    assert_eq!(judged([(0, 0), (0, 0)]), Verdict::Unclear);
    assert_eq!(judged([(300, -50), (0, 0)]), Verdict::Reversed);
    assert_eq!(judged([(0, 0), (-300, 50)]), Verdict::Reversed);
    assert_eq!(judged([(300, 50), (-300, 50)]), Verdict::Reversed, "one of two");
}

#[test]
fn joint_that_carries_weight_is_judged_where_it_is_lifted() {
    let config = config();
    let mut carrying = 0;
    for joint in Joint::ALL {
        let breakaway = breakaway(&config, joint, &rest(&config));
        if breakaway.weight.abs() <= breakaway.centres.max(breakaway.friction) {
            continue;
        }
        carrying += 1;
        let lifts = breakaway.weight + breakaway.friction * breakaway.weight.signum();
        let moved = |torque: f64| {
            let target = target(&config, joint, torque);
            (target, i32::from(target.signum()) * 100)
        };
        let judged = |one, other, is_last| judged(&config, joint, [one, other], is_last);
        assert_eq!(judged(moved(lifts), (0, 0), false), Verdict::Right, "{joint}");
        assert_eq!(
            judged(moved(lifts), moved(-lifts), false),
            Verdict::Right,
            "{joint}: a soft rest"
        );
        for times in [0.2, 5.0] {
            let other = judged(moved(lifts * times), (0, 0), false);
            if (lifts * times).abs() > breakaway.capacity {
                continue;
            }
            assert!(
                matches!(other, Verdict::OtherTorque { what: Resistance::Weight, .. }),
                "{joint}: {other:?}"
            );
        }
        assert_eq!(
            judged(moved(-lifts / 9.0), (0, 0), false),
            Verdict::Unclear,
            "{joint} has sunk"
        );
        assert_eq!(judged(moved(-lifts / 9.0), (0, 0), true), Verdict::Right, "{joint} has sunk");
    }
    assert!(carrying >= 2, "{carrying}");
}

#[test]
fn joint_without_weight_is_judged_by_its_friction_both_ways() {
    let (config, joint) = (config(), Joint::of::<1>());
    let friction = breakaway(&config, joint, &rest(&config)).friction;
    let judged = |forth: f64, back: f64, is_last| {
        let [forth, back] = [forth, -back].map(|share| target(&config, joint, share * friction));
        judged(&config, joint, [(forth, i32::from(forth)), (back, i32::from(back))], is_last)
    };
    assert_eq!(judged(1.2, 0.9, false), Verdict::Right);
    assert_eq!(judged(2.5, 0.0, false), Verdict::Unclear, "one way");
    assert_eq!(judged(2.5, 0.0, true), Verdict::Right);
    for times in [0.2, 6.0] {
        let other = judged(times, times, true);
        assert!(
            matches!(other, Verdict::OtherTorque { what: Resistance::Friction, .. }),
            "{other:?}"
        );
    }
}

#[test]
fn torque_and_motion_are_those_of_the_joint() {
    let config = config();
    let calibration = &config.controller.calibration;
    for joint in Joint::ALL {
        let parameters = joint.entry(&config.joints);
        let torque = |torque: f64| {
            let target = target(&config, joint, torque);
            torque_of(parameters, target)
        };
        assert!((torque(0.1) - 0.1).abs() < 5e-3 && (torque(-0.1) + 0.1).abs() < 5e-3, "{joint}");
        let [to, from] = [0.1, 0.0].map(|at| calibration.counts(&JointVector::repeat(at)));
        let (Counts(to), Counts(from)) = (*joint.entry(&to), *joint.entry(&from));
        let turned = motion(parameters, &TrialAnswer { torque: 0, counts: to - from });
        assert!((turned - 0.1).abs() < 1e-3, "{joint}: {turned}");
    }
}

fn torque_of(joint: &JointParameters, target: i16) -> f64 {
    torque(joint, &TrialAnswer { torque: target, counts: 0 })
}
