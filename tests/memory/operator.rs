//! Hazards of operation: deadman, switches, arming, disarming, uncommanded motion. Runs on the in-memory bus; the
//! figures are those of docs/safety.md.

use nalgebra::Isometry3;

use crate::common::prelude::*;
use config::JointPlant;
use controller::arm::{Arm, Link};
use telemetry::summary::Summary;
use testbench::comparison;

/// Armed, engaged at 0.3 s, reflection on at 0.4 s; the hand moves sideways from 0.55 s to 1.15 s.
const ENGAGED: &str = "[[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.3\ndeadman = true\n\
    [[switch]]\nat_s = 0.4\nreflection = true\n[[switch]]\nat_s = 0.45\nreflection = false\n\
    [[switch]]\nat_s = 0.5\nreference = true\n[[switch]]\nat_s = 0.55\nreference = false\n\
    [[move]]\nat_s = 0.55\nduration_s = 0.6\nto_m = [0.0, 0.12, 0.0]\n";

/// Maximum change of a torque per cycle, as a share of the joint's capacity: all of it in 20 ms.
const SLEW: f64 = 0.05;

fn bench_of(config: &Config, text: &str) -> Bench<()> {
    started(config, script(&format!("seconds = 100\n{text}")), ())
}

/// Returns the records of a scenario until `seconds`.
fn records(config: &Config, script: &str, seconds: f64) -> Vec<Record> {
    let mut bench = bench_of(config, script);
    let mut records = Vec::new();
    while bench.elapsed().as_secs_f64() < seconds {
        records.push(bench.cycle());
    }
    records
}

/// Returns the first cycle after `from` in which `bit` of the node's inputs changes.
fn turned(records: &[Record], from: usize, bit: u8) -> usize {
    let is_turned = |pair: &[Record]| {
        let [before, after] = [0, 1].map(|place: usize| pair[place].inputs.unwrap() & bit);
        before != after
    };
    from + 1 + records[from..].windows(2).position(is_turned).unwrap()
}

/// Returns the first cycle in a mode.
fn first_in(records: &[Record], mode: Mode) -> usize {
    records.iter().position(|record| record.mode == mode).unwrap()
}

/// Returns the largest change of a torque between two of these cycles, as a share of its capacity.
fn largest_step(config: &Config, records: &[Record]) -> f64 {
    let capacities = config.joints.each_ref().map(|joint| joint.plant.actuator.max_torque);
    let steps = records.windows(2).flat_map(|pair| {
        let by = pair[1].output.tau - pair[0].output.tau;
        by.iter().zip(capacities).map(|(by, capacity)| by.abs() / capacity).collect::<Vec<_>>()
    });
    steps.fold(0.0, f64::max)
}

/// Returns the largest torque without gravity compensation, as a share of the joint's capacity.
fn felt(config: &Config, record: &Record) -> f64 {
    let felt = record.output.tau - record.output.ledger.gravity;
    let parts = felt
        .iter()
        .zip(&config.joints)
        .map(|(tau, joint)| tau.abs() / joint.plant.actuator.max_torque);
    parts.fold(0.0, f64::max)
}

#[test]
fn hazard_38_and_promise_08_deadman_release_ends_reflection() {
    let config = config(KRAFT);
    let release = "[[switch]]\nat_s = 1.0\ndeadman = false\n";
    let records = records(&config, &format!("{ENGAGED}{release}"), 1.2);
    let engaged = first_in(&records, Mode::Engaged);
    let open = turned(&records, engaged, 0b01);
    assert!(
        matches!(records[open - 1].output.command, Motion::Rate(v_m) if v_m.linear.norm() > 1e-3)
    );
    assert!(felt(&config, &records[open - 1]) > 1e-3, "a reflected or assisting torque");
    // The two contacts open at different times; the first one ends the command.
    assert_eq!(records[open].mode, Mode::Armed);
    assert!(records[open..].iter().all(|record| record.output.command == Motion::Hold));
    assert!(records[open + 20..].iter().all(|record| felt(&config, record) < 1e-9));
    assert!(largest_step(&config, &records[open - 1..]) <= SLEW + 1e-9);
}

#[test]
fn hazard_38_silent_switch_box_counts_as_released_deadman() {
    let config = config(KRAFT);
    let mut bench = bench_of(&config, ENGAGED);
    while bench.elapsed().as_secs_f64() < 1.0 {
        bench.cycle();
    }
    bench.world_mut().switches_mut().unwrap().unplug();
    let last = (0..).find(|_| bench.cycle().mode != Mode::Engaged).unwrap();
    assert!(last <= 15, "after {last} cycles");
    assert_eq!(bench.node().mode(), Mode::Armed);
}

#[test]
fn hazard_39_deadman_closed_at_power_up_prevents_arming() {
    let config = config(KRAFT);
    let script = "[[switch]]\nat_s = 0.0\ndeadman = true\n\
        [[switch]]\nat_s = 1.0\ndeadman = false\n[[switch]]\nat_s = 1.2\ndeadman = true\n";
    let mut bench = bench_of(&config, script);
    bench.run(100);
    let refusal = bench.ask(Request::Arm).unwrap_err();
    assert_eq!(refusal.to_string(), "the deadman is closed: release it first");
    while bench.elapsed().as_secs_f64() < 1.1 {
        assert_eq!(bench.cycle().mode, Mode::Ready);
    }
    bench.ask(Request::Arm).unwrap();
    while bench.elapsed().as_secs_f64() < 1.3 {
        bench.cycle();
    }
    assert_eq!(bench.node().mode(), Mode::Engaged);
}

#[test]
fn hazard_40_reference_or_mode_change_gives_no_impulse() {
    let config = config(KRAFT);
    let changes = "[[switch]]\nat_s = 1.0\nreference = true\n[[switch]]\nat_s = 1.04\nreference = false\n\
        [[console]]\nat_s = 1.1\nrequest = \"mode pose\"\n\
        [[switch]]\nat_s = 1.15\nreference = true\n[[switch]]\nat_s = 1.2\nreference = false\n\
        [[console]]\nat_s = 1.3\nrequest = \"mode rate\"\n";
    let records = records(&config, &format!("{ENGAGED}{changes}"), 1.6);
    let from = first_in(&records, Mode::Engaged);
    assert!(largest_step(&config, &records[from..]) <= SLEW + 1e-9);
    let moving = records.iter().filter(|record| record.output.twist.v_g.linear.norm() > 0.02);
    assert!(moving.count() > 200, "the hand moves");

    // The second reference: 0.8 s is after the first one, at 0.5 s.
    let second =
        records.iter().position(|record| record.at.since(records[0].at).as_secs_f64() > 0.8);
    let pressed = turned(&records, second.unwrap(), 0b100);
    let counts = |record: &Record| record.output.permissions.reference;
    let set = pressed + records[pressed..].iter().position(counts).unwrap();
    assert!((25..=26).contains(&(set - pressed)), "a press counts after debouncing");
    let rate = |record: &Record| match record.output.command {
        Motion::Rate(v_m) => v_m.linear.norm(),
        Motion::Hold | Motion::Pose(_) => 0.0,
    };
    assert!(rate(&records[set - 1]) > 1e-3 && rate(&records[set]) == 0.0);

    // The object does not jump at a change between rates and poses.
    let poses = records[from..].windows(2);
    let jumps = poses.map(|pair| {
        let moved: Isometry3<f64> = pair[0].x_b_m.inverse() * pair[1].x_b_m;
        moved.translation.vector.norm()
    });
    assert!(jumps.fold(0.0, f64::max) < 1e-3);
}

/// Returns the records of [`ENGAGED`] with these faults of the switch box.
fn with_faults(seed: u64, faults: &str) -> Vec<Record> {
    let mut bench =
        Bench::new(&config(KRAFT), script(&format!("seconds = 100\n{ENGAGED}{faults}")), seed, ());
    bench.bring_up().unwrap();
    (0..1_400).map(|_| bench.cycle()).collect()
}

#[test]
fn hazard_39_bounce_of_reflection_or_reference_is_one_press() {
    for seed in 1..=8 {
        let bounce = |(at, switch): (f64, &str)| {
            let kind = format!("kind = \"switch_bounce\"\nswitch = \"{switch}\"\nfor_s = 0.02");
            format!("[[fault]]\nat_s = {at}\n{kind}\n")
        };
        let edges = [0.4, 0.45].map(|at| (at, "reflection"));
        let edges = edges.into_iter().chain([0.5, 0.55].map(|at| (at, "reference")));
        let records = with_faults(seed, &edges.map(bounce).collect::<String>());
        let presses = records.windows(2).filter(|pair| {
            let [before, after] =
                [0, 1].map(|place: usize| pair[place].output.permissions.reference);
            !before && after
        });
        assert_eq!(presses.count(), 1, "seed {seed}");
        let last = records.last().unwrap();
        assert_eq!((last.mode, last.output.permissions.task), (Mode::Engaged, true), "seed {seed}");
    }
}

#[test]
fn hazard_39_returning_switch_box_toggles_nothing() {
    for for_s in [0.025, 0.1] {
        // Reflection is pressed again at 0.7 s, which turns it off, and held while the box is silent.
        let script = format!(
            "[[switch]]\nat_s = 0.7\nreflection = true\n\
             [[fault]]\nat_s = 0.8\nkind = \"drop\"\ndevice = \"switches\"\nframe = \"tpdo1\"\nfor_s = {for_s}\n\
             [[switch]]\nat_s = 1.0\ndeadman = false\n[[switch]]\nat_s = 1.1\ndeadman = true\n"
        );
        let records = with_faults(1, &script);
        let is_silent = |record: &&Record| record.inputs.is_none() && record.mode == Mode::Armed;
        assert!(records.iter().filter(is_silent).count() >= 5, "{for_s} s");
        let last = records.last().unwrap();
        assert_eq!((last.mode, last.output.permissions.task), (Mode::Engaged, false), "{for_s} s");
    }
}

#[test]
fn hazard_41_reflection_enabled_in_contact_ramps_in_300_ms() {
    let config = config(KRAFT);
    // In pose mode without reflection, the hand presses into the wall; then reflection is enabled.
    let script = "[[console]]\nat_s = 0.05\nrequest = \"mode pose\"\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
        [[switch]]\nat_s = 1.5\ndeadman = true\n\
        [[move]]\nat_s = 1.8\nduration_s = 0.7\nto_m = [0.06, 0.0, 0.0]\n\
        [[switch]]\nat_s = 3.0\nreflection = true\n[[switch]]\nat_s = 3.05\nreflection = false\n";
    let records = records(&config, script, 3.6);
    let on = records.iter().position(|record| record.output.permissions.task).unwrap();
    let share = |after: usize| {
        let record = &records[on + after];
        record.output.f_g_task.force.norm() / record.output.f_m_task.force.norm()
    };
    assert!(records[on].output.f_m_task.force.norm() > 2.0, "contact");
    assert!(share(0) < share(290) / 250.0, "{} of {}", share(0), share(290));
    assert!((1..300).all(|cycle| share(cycle) <= share(290) * 1.1));
    assert!((share(150) / share(310) - 0.5).abs() < 0.1, "{} of {}", share(150), share(310));
    assert!(largest_step(&config, &records[on - 1..]) <= SLEW + 1e-9);
}

#[test]
fn hazard_41_overestimated_mass_trips_on_uncommanded_motion() {
    // Masses that a configuration file cannot have: the motors could not hold the arm.
    let configured = config(KRAFT);
    let links = configured.plant().joints.map(|JointPlant { link, .. }| Link {
        mass: if link.mass < 1.0 { link.mass + 2.0 } else { link.mass + 20.0 },
        ..link
    });
    let arm = Arm::new(links, configured.x_6_g, configured.gravity).unwrap();
    let controller = controller::Settings { arm, ..configured.controller };
    let overestimated = configured.with_controller(controller);
    // A hand of low impedance.
    let relaxed = "seconds = 10\n[hand]\npreset = \"relaxed\"\n\
        [[console]]\nat_s = 0.1\nrequest = \"arm\"\n";
    let script = script(relaxed);
    let mut bench = Bench::in_world_of(&config(KRAFT), &overestimated, script.clone(), 1, ());
    bench.bring_up().unwrap();
    bench.run(1_600);
    let cause = bench.node().cause();
    // Distance and speed of the uncommanded motion are both monitored, at the joints and at the grip.
    let is_motion = |cause: &Cause| {
        matches!(cause, Cause::UncommandedMotion | Cause::GripOverspeed | Cause::Overspeed { .. })
    };
    assert!(cause.as_ref().is_some_and(is_motion), "{cause:?}");
    assert!(bench.node().mode().is_stopped());

    let mut correct = started(&config(KRAFT), script, ());
    correct.run(1_500);
    assert_eq!((correct.node().mode(), correct.node().cause()), (Mode::Armed, None));
}

#[test]
fn hazard_30_and_hazard_41_disarming_ramps_down_in_50_ms() {
    let config = config(KRAFT);
    let mut bench = bench_of(&config, ENGAGED);
    while bench.elapsed().as_secs_f64() < 1.5 {
        bench.cycle();
    }
    let before = bench.cycle();
    bench.ask(Request::Disarm).unwrap();
    let mut records = vec![before];
    records.extend((0..60).map(|_| bench.cycle()));
    assert!(records[1..].iter().all(|record| record.output.command == Motion::Hold));
    assert!(records[1..51].iter().any(|record| record.targets != [0; 6]));
    assert!(records[52..].iter().all(|record| record.targets == [0; 6]));
    assert_eq!(records[55].mode, Mode::Ready);
    assert!(largest_step(&config, &records) <= SLEW + 1e-9);
    let most = config.joints.each_ref().map(|joint| joint.calibration.max_target().0);
    for pair in records.windows(2) {
        let by =
            pair[0].targets.iter().zip(pair[1].targets).map(|(one, other)| (one - other).abs());
        assert!(by.zip(most).all(|(by, most)| by <= most / 15), "{:?}", pair[1].targets);
    }
}

#[test]
fn hazard_45_stiff_wall_within_the_gains_does_not_trip() {
    let script = scenario("stiff-wall");
    let config = comparison::surrounded(&config(KRAFT), &script);
    let mut bench = started(&config, script, ());
    while bench.elapsed().as_secs_f64() < 7.0 {
        assert_eq!(bench.cycle().cause, None);
    }
}

/// Presses into the wall in rate mode, and lets go at 6.0 s.
const LETTING_GO: &str = "[[console]]\nat_s = 0.05\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 1.1\ndeadman = true\n\
    [[switch]]\nat_s = 1.2\nreflection = true\n[[switch]]\nat_s = 1.25\nreflection = false\n\
    [[switch]]\nat_s = 1.4\nreference = true\n[[switch]]\nat_s = 1.45\nreference = false\n\
    [[move]]\nat_s = 1.6\nduration_s = 0.6\nto_m = [0.045, 0.0, 0.0]\n\
    [[move]]\nat_s = 6.0\nduration_s = 0.6\nto_m = [-0.03, 0.0, 0.0]\n";

#[test]
fn promise_14_samples_lost_while_letting_go_do_not_trip() {
    let config = config(KRAFT_500HZ);
    // The wall pushes the hand out: energy from the torques. Each loss is a speed that is wrong to both sides.
    let lost = |ms| {
        let at_s = 1e-3 * f64::from(ms);
        format!(
            "[[fault]]\nat_s = {at_s}\nkind = \"drop\"\njoint = 3\nframe = \"tpdo1\"\ncount = 1\n"
        )
    };
    let losses: String = (6_200..6_450).step_by(50).map(lost).collect();
    let records = records(&config, &format!("{LETTING_GO}{losses}"), 7.0);
    assert_eq!(records.iter().find_map(|record| record.cause), None);
    assert!(records.iter().any(|record| record.f_s.force.norm() > 2.0), "in contact");
    let incomplete = |record: &&Record| record.mode == Mode::Engaged && record.sampled != [true; 6];
    assert_eq!(records.iter().filter(incomplete).count(), 5);
}

#[test]
fn summary_counts_every_engagement() {
    let twice = format!(
        "{ENGAGED}[[switch]]\nat_s = 1.2\ndeadman = false\n[[switch]]\nat_s = 1.4\ndeadman = true\n"
    );
    let records = records(&config(KRAFT), &twice, 1.6);
    let mut summary = Summary::default();
    records.iter().for_each(|record| summary.add(record));
    let engaged = records.iter().filter(|record| record.mode == Mode::Engaged).count();
    assert_eq!(summary.engagements, 2);
    let seconds = 1e-3 * f64::from(u32::try_from(engaged).unwrap());
    assert!((summary.engaged_seconds - seconds).abs() < 0.01, "{}", summary.engaged_seconds);
}
