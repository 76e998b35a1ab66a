//! Fidelity at the hand, in the simulation's own truth: still contact, drag, releases, and friction
//! compensation that moves nothing by itself.
#![allow(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::path::Path;

use config::Config;
use controller::arm::JointKind;
use lab::bench::Bench;
use lab::fidelity::script::{HANDS, Hand};
use lab::fidelity::trial::{Arm, Trial};
use node::record::{Mode, Record};
use sim::scenario::Scenario;
use units::numbering::Joint;

const CONFIGS: [&str; 3] =
    ["config/kraft_like.toml", "config/kraft_like_500hz.toml", "config/jpl_like.toml"];

fn config(name: &str) -> Config {
    Config::load(Path::new(name)).unwrap()
}

fn trial(name: &str, arm: Arm, hand: &Hand) -> Trial {
    Trial::run(&config(name), arm, hand, 1, |_, _| {}).unwrap()
}

#[test]
fn still_contact_is_felt_as_sensed() {
    for (name, limit) in CONFIGS.into_iter().zip([0.08, 0.08, 0.035]) {
        let trial = trial(name, Arm::Identified, &HANDS[0]);
        let still = trial.still().unwrap();
        assert_eq!(trial.saturated_cycles, 0, "{name}");
        assert!((7.0..12.0).contains(&still.wanted_rms_n), "{name}: {still:?}");
        assert!(still.relative_error() < limit, "{name}: {still:?}");
    }
}

#[test]
fn without_friction_only_inertia_is_left() {
    for name in CONFIGS {
        let still = trial(name, Arm::Frictionless, &HANDS[0]).still().unwrap();
        assert!(still.beyond_assist_rms_n < 0.01 * still.wanted_rms_n, "{name}: {still:?}");
    }
}

#[test]
fn drag_beyond_the_assist_is_below_one_newton() {
    for name in CONFIGS {
        let report = trial(name, Arm::Identified, &HANDS[0]).report().unwrap();
        let free = report.free_motion.unwrap();
        assert!(free.beyond_assist_rms_n < 1.0, "{name}: {free:?}");
        assert!(free.shares.damping_n > 0.5, "{name}: K_D is felt: {free:?}");
    }
}

#[test]
fn hand_that_lets_go_of_11_n_is_not_braked() {
    for name in CONFIGS {
        for hand in &HANDS {
            let trial = trial(name, Arm::Identified, hand);
            assert!(trial.release.peak_n() < 1.0, "{name}, {hand}: {:?}", trial.release);
            assert_eq!(trial.stopped_by, None, "{name}, {hand}");
        }
    }
}

/// Plays a scenario, and returns the records.
fn play(config: &Config, scenario: &str) -> Vec<Record> {
    let scenario = Scenario::parse(scenario).unwrap();
    let cycles = config.controller.period.cycles(scenario.seconds());
    let mut bench = Bench::new(config, scenario, 7, false, ());
    bench.bring_up().unwrap();
    (0..cycles).map(|_| bench.cycle()).collect()
}

/// Returns the places of maxima from which the values fall by more than `drop` to both sides.
fn prominent_peaks(values: &[f64], drop: f64) -> Vec<usize> {
    let (mut peaks, mut rises) = (Vec::new(), true);
    let (mut highest, mut lowest) = ((0, 0.0_f64), 0.0_f64);
    for (place, value) in values.iter().copied().enumerate() {
        if rises && value > highest.1 {
            highest = (place, value);
        } else if rises && value < highest.1 - drop {
            peaks.push(highest.0);
            (rises, lowest) = (false, value);
        } else if !rises && value > lowest + drop {
            (rises, highest) = (true, (place, value));
        } else if !rises {
            lowest = lowest.min(value);
        }
    }
    peaks
}

#[test]
fn passivity_damper_does_not_chatter_in_rate_mode() {
    let scenario = include_str!("../../config/scenarios/contact_10s.toml");
    for name in ["config/kraft_like.toml", "config/jpl_like.toml"] {
        let records = play(&config(name), scenario);
        let forces = records.iter().map(|record| record.output.port.f_g_passivity.force);
        let forces: Vec<_> = forces.collect();
        let changes = forces.windows(2).map(|pair| (pair[1] - pair[0]).norm());
        let largest = changes.fold(0.0, f64::max);
        assert!(largest <= 0.5, "{name}: {largest} N in a cycle");
        let sizes: Vec<f64> = forces.iter().map(|force| force.norm()).collect();
        let peaks = prominent_peaks(&sizes, 0.2);
        let closest = peaks.windows(2).map(|pair| pair[1] - pair[0]).min();
        assert!(closest.is_none_or(|cycles| cycles >= 20), "{name}: {peaks:?}");
    }
}

/// Engaged in pose mode, the hand lets the grip go at 6 s: in free space, or on the wall.
fn let_go(to_m: f64) -> String {
    format!(
        "seconds = 60\n\
         [[console]]\nat_s = 0.1\nrequest = \"mode pose\"\n\
         [[console]]\nat_s = 0.2\nrequest = \"arm\"\n\
         [[switch]]\nat_s = 1.5\ndeadman = true\n\
         [[switch]]\nat_s = 1.6\nreflection = true\n\
         [[switch]]\nat_s = 1.7\nreflection = false\n\
         [[move]]\nat_s = 2.5\nduration_s = 1.5\nto_m = [{to_m}, 0.0, 0.0]\n\
         [[hold]]\nat_s = 6\nholding = false\n"
    )
}

/// Minimum-jerk step from 0 to 1.
fn smooth(share: f64) -> f64 {
    let s = share.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// A finger leads the joint by 1° within 0.3 s, stops, and leaves it at 0.4 s.
fn nudge(bench: &mut Bench<()>, config: &Config, joint: Joint) {
    let period = config.controller.period;
    let place = joint.index();
    let stiffness = 8.0 * config.joints[place].plant.actuator.max_torque;
    let before = *bench.world().plant().q();
    for cycle in 0..=period.cycles(0.4) {
        let plant = bench.world().plant();
        let by = 1_f64.to_radians() * smooth(f64::from(cycle) * period.seconds() / 0.3);
        let mut push = before * 0.0;
        let (q, qd) = (plant.q()[place], plant.qd()[place]);
        push[place] = stiffness * (before[place] + by - q - 0.02 * qd);
        bench.world_mut().set_push(&push);
        bench.cycle();
    }
    bench.world_mut().set_push(&(before * 0.0));
}

/// Nudges a joint of an arm with 30 % less friction than identified, in free space or on the wall, hands off. Returns
/// how far it moves within 0.5 s, and any joint in the 0.5 s after, in degrees.
fn nudged(config: &Config, to_m: f64, joint: Joint) -> [f64; 2] {
    let world = config.clone().with_friction(Arm::LessFriction.friction());
    let period = config.controller.period;
    let scenario = Scenario::parse(&let_go(to_m)).unwrap();
    let mut bench = Bench::in_world_of(&world, config, scenario, 1, false, ());
    bench.bring_up().unwrap();
    bench.run(period.cycles(7.0).into());
    nudge(&mut bench, config, joint);
    let nudged = bench.world().plant().q()[joint.index()];
    assert_eq!(bench.cycle().mode, Mode::Engaged, "{joint}, {to_m}");
    bench.run(period.cycles(0.5).into());
    let rest = *bench.world().plant().q();
    bench.run(period.cycles(0.5).into());
    let creeps = (bench.world().plant().q() - rest).amax();
    [(rest[joint.index()] - nudged).abs(), creeps].map(f64::to_degrees)
}

#[test]
fn nudged_joint_with_less_friction_comes_to_rest() {
    for name in CONFIGS {
        let config = config(name);
        for joint in Joint::ALL {
            // A slide is led by 1° as by 17 mm: the wall throws it back, compensated or not.
            let is_slide = config.joints[joint.index()].plant.link.kind == JointKind::Prismatic;
            for to_m in [0.05, 0.135].into_iter().filter(|_| !is_slide) {
                let [moved, creeps] = nudged(&config, to_m, joint);
                // The wall goes on pushing an arm that nothing holds.
                let most = if to_m > 0.1 { 0.2 } else { 0.05 };
                assert!(creeps < most, "{name}, {joint}, {to_m}: creeps {creeps}°");
                // The goal is 0.5°. Elevation on the wall is pushed back by 0.57°: the wall's force, not the compensation's.
                let most = if to_m > 0.1 { 0.6 } else { 0.5 };
                assert!(moved < most, "{name}, {joint}, {to_m}: {moved}°");
            }
        }
    }
}
