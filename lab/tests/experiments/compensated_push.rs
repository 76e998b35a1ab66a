//! Pushes on arms with other friction than configured, hands off: friction compensation drives no joint on.

use crate::common::prelude::*;
use controller::arm::JointKind;
use experiments::fidelity::script::{Course, HANDS};

/// Real friction, as shares of the configured one: 1.0 is what the gains were chosen for.
const FRICTION: [f64; 5] = [0.3, 0.5, 0.6, 1.0, 1.5];

/// Scenario of the demo.
const TELEOPERATION: &str = include_str!("../../../config/scenarios/teleoperation.toml");

/// Engaged in pose mode in free space, the hand lets the grip go at 4 s.
const LET_GO: &str = "seconds = 60\n\
    [[console]]\nat_s = 0.1\nrequest = \"mode pose\"\n\
    [[console]]\nat_s = 0.2\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 1.5\ndeadman = true\n\
    [[switch]]\nat_s = 1.6\nreflection = true\n\
    [[switch]]\nat_s = 1.7\nreflection = false\n\
    [[move]]\nat_s = 2.0\nduration_s = 1.2\nto_m = [0.05, 0.0, 0.0]\n\
    [[hold]]\nat_s = 4.0\nholding = false\n";

/// Returns an engaged arm that no hand holds, with `friction` times the configured friction.
fn released(config: &Config, friction: f64) -> Bench<()> {
    let world = config.clone().with_friction(friction);
    let scenario = script(LET_GO);
    let mut bench = Bench::in_world_of(&world, config, scenario, 1, ());
    bench.bring_up().unwrap();
    bench.run(config.controller.period.cycles(5.0).into());
    let record = bench.cycle();
    assert_eq!((record.mode, record.cause), (Mode::Engaged, None), "{friction} of the friction");
    bench
}

/// Motion of a joint after a push.
#[derive(Clone, Copy, Debug, Default)]
struct Coasting {
    /// In 1 s, in rad or m.
    travel: f64,
    /// Time of rest after the push, in s.
    rest: f64,
    /// Highest speed of any joint later than 0.3 s after the push, in rad/s or m/s.
    late_speed: f64,
    /// The compensation was withdrawn.
    is_withdrawn: bool,
}

/// Pushes `joint` for 0.1 s with `torque`.
fn push(mut bench: Bench<()>, config: &Config, joint: Joint, torque: f64) -> Coasting {
    let period = config.controller.period;
    let place = joint.index();
    let mut push = *bench.world().plant().q() * 0.0;
    push[place] = torque;
    bench.world_mut().set_push(&push);
    bench.run(period.cycles(0.1).into());
    bench.world_mut().set_push(&(push * 0.0));
    let start = bench.world().plant().q()[place];
    let mut coasting = Coasting::default();
    for cycle in 0..period.cycles(1.0) {
        coasting.is_withdrawn |= bench.cycle().output.ledger.self_driven.is_some();
        let t = f64::from(cycle) * period.seconds();
        let rates = bench.world().plant().qd();
        if rates[place].abs() > 0.005 {
            coasting.rest = t;
        }
        if t > 0.3 {
            coasting.late_speed = coasting.late_speed.max(rates.amax());
        }
    }
    coasting.travel = (bench.world().plant().q()[place] - start).abs();
    coasting
}

/// Pushes every joint both ways with four times its dry friction.
fn pushed_joints_come_to_rest(name: &str) {
    let config = config(&format!("config/{name}.toml"));
    for friction in FRICTION {
        let bench = released(&config, friction);
        let mut worst = Coasting::default();
        for joint in Joint::ALL {
            let plant = &config.joints[joint.index()].plant;
            let is_slide = plant.link.kind == JointKind::Prismatic;
            let most = if is_slide { 0.02 } else { 5_f64.to_radians() };
            for torque in [4.0, -4.0].map(|times| times * friction * plant.friction.coulomb) {
                let found = push(bench.clone(), &config, joint, torque);
                assert!(
                    found.rest < 0.5 && found.travel < most && found.late_speed < 0.5,
                    "{name}, {joint}, {torque} N·m, friction {friction}: {found:?}"
                );
                assert!(!found.is_withdrawn, "{name}, {joint}, friction {friction}");
                worst.rest = worst.rest.max(found.rest);
                worst.travel = worst.travel.max(found.travel);
                worst.late_speed = worst.late_speed.max(found.late_speed);
            }
        }
        println!("{name}, friction {friction}: {worst:?}");
    }
}

#[test]
fn pushed_joint_of_kraft_like_comes_to_rest() {
    pushed_joints_come_to_rest("kraft_like");
}

#[test]
fn pushed_joint_at_500_hz_comes_to_rest() {
    pushed_joints_come_to_rest("kraft_like_500hz");
}

#[test]
fn pushed_joint_of_jpl_like_comes_to_rest() {
    pushed_joints_come_to_rest("jpl_like");
}

#[test]
fn pushed_joint_of_sixr_spherical_comes_to_rest() {
    pushed_joints_come_to_rest("sixr_spherical");
}

#[test]
fn hand_that_moves_the_arm_keeps_its_compensation() {
    let runs = [("kraft_like", 1, 0.7), ("kraft_like", 3, 1.3), ("jpl_like", 0, 0.7)];
    for (name, hand, friction) in runs {
        keeps_compensation(name, hand, friction);
    }
}

#[test]
#[ignore = "36 runs: two minutes"]
fn hands_of_the_experiment_keep_their_compensation() {
    for name in ["kraft_like", "jpl_like", "sixr_spherical"] {
        for hand in 0..HANDS.len() {
            for friction in [0.7, 1.0, 1.3] {
                keeps_compensation(name, hand, friction);
            }
        }
    }
}

/// Plays the experiment `fidelity`: all its holds, and a release in rate mode.
fn keeps_compensation(name: &str, hand: usize, friction: f64) {
    let config = config(&format!("config/{name}.toml"));
    let world = config.clone().with_friction(friction);
    for (course, felt_n) in [(Course::Full, 9.0), (Course::RateRelease, 2.0)] {
        let scenario = course.script(&config, &HANDS[hand], felt_n).unwrap();
        let mut bench = Bench::in_world_of(&world, &config, scenario, 1, ());
        bench.bring_up().unwrap();
        for _ in 0..config.controller.period.cycles(course.times().end) {
            let record = bench.cycle();
            let case = format!("{name}, {hand}, {friction}, {course:?}");
            assert_eq!(record.output.ledger.self_driven, None, "{case}");
            assert_eq!(record.cause, None, "{case}");
        }
    }
}

#[test]
fn joint_almost_without_friction_stays_slow() {
    let config = config(SIXR);
    let bench = released(&config, 0.05);
    for joint in Joint::ALL {
        let torque = 2.0 * config.joints[joint.index()].plant.friction.coulomb;
        let found = push(bench.clone(), &config, joint, torque);
        // Several joints that creep together look like a hand that leads them: ADR 34.
        assert!(found.late_speed < 0.8, "{joint}: {found:?}");
    }
}

#[test]
fn teleoperation_keeps_its_compensation() {
    for name in ["kraft_like", "jpl_like", "sixr_spherical"] {
        let mut bench = started(&config(&format!("config/{name}.toml")), script(TELEOPERATION), ());
        while bench.elapsed().as_secs_f64() < 60.0 {
            let record = bench.cycle();
            assert_eq!(record.output.ledger.self_driven, None, "{name} at {:?}", bench.elapsed());
        }
    }
}
