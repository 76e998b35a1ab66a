//! Every scenario in config/scenarios/faults: the reaction of the node, and the faults it does not detect.

use nalgebra::SVector;

use crate::common::prelude::*;
use faults::{LinkFault, Target};
use node::cause;

/// Reaction of the node to a fault.
#[derive(Clone, Copy, Debug)]
enum Node {
    /// It stops for this cause; targets are zero within a number of cycles, and then no drive exerts torque.
    Stops(&'static str, Within),
    /// It disengages within this many cycles, until the operator presses the deadman again.
    Disengages(u64),
    /// It ends reflection for this cause within these minimum and maximum numbers of cycles; gravity compensation continues.
    EndsReflection(&'static str, [u64; 2]),
    /// It continues, for this reason.
    GoesOn(&'static str),
}

/// Times in cycles since the fault.
#[derive(Clone, Copy, Debug)]
struct Within {
    /// Until every target is zero.
    zero: u64,
    /// Until no drive exerts torque.
    torque_free: u64,
}

const fn within(zero: u64, torque_free: u64) -> Within {
    Within { zero, torque_free }
}

use Node::{Disengages, EndsReflection, GoesOn, Stops};

const DRIVES: &[(&str, Node)] = &[
    ("unplug", Stops("joint 3: no sample for 3 cycles", within(5, 6))),
    ("reset", Stops("joint 3: rebooted", within(2, 3))),
    ("fault", Stops("joint 3: emergency 3210h DC link over-voltage", within(2, 3))),
    ("sto", Stops("drive left operation enabled", within(2, 3))),
    ("emergency", Stops("joint 3: emergency 4210h device temperature too high", within(2, 3))),
    ("wire_cut", Stops("joint 4: no sample for 3 cycles", within(5, 6))),
    ("bus_off", Stops("joint 3: no sample for 3 cycles", within(5, 6))),
    // Heartbeats are watched for 250 ms, from the last one on.
    ("heartbeat_stop", Stops("joint 3: heartbeat lost", within(252, 254))),
    ("switches_unplugged", Stops("switch box: heartbeat lost", within(252, 254))),
];

const FRAMES: &[(&str, Node)] = &[
    ("drop", Stops("joint 3: no sample for 3 cycles", within(5, 6))),
    ("drop_some", Stops("samples late or lost", within(300, 301))),
    ("rpdo_lost", Stops("joint 3: emergency 8250h RPDO timeout", within(8, 9))),
    // Its last torque acts until it is switched off: a synchronous RPDO waits for a SYNC.
    ("sync_lost", Stops("joint 3: no sample for 3 cycles", within(5, 110))),
    ("resize", Stops("joint 3: no sample for 3 cycles", within(5, 6))),
    ("delay", GoesOn("a constant lateness looks like none, and moves little: 4")),
    ("reorder", GoesOn("a late sample never replaces a newer one: 4")),
    ("duplicate", Stops("joint 3: node-id apparently used by two nodes", within(3, 4))),
    ("impersonate", Stops("joint 3: node-id apparently used by two nodes", within(3, 4))),
    ("freeze", Stops("joint 2: position frozen under torque", within(505, 506))),
    ("corrupt", GoesOn("a single sample that cannot be is discarded: 12")),
];

const SENSES: &[(&str, Node)] = &[
    ("encoder_jump", Stops("joint 3: position jumped", within(3, 4))),
    ("encoder_frozen", Stops("joint 2: position frozen under torque", within(505, 506))),
    // The torque is sent at every 99th SYNC here, and the second one counts.
    (
        "torque_actual_scale",
        Stops("joint 2: actual torque differs from the target torque", within(201, 202)),
    ),
    // The hand opens the deadman 300 ms after its contact sticks.
    ("deadman_stuck", Stops("deadman channels disagree", within(352, 353))),
    // The first bounce is random, here in the third cycle; the node does not engage again without a command.
    ("deadman_bounce", Disengages(5)),
];

const FOREIGN: &[(&str, Node)] = &[
    ("foreign_sync", Stops("another master is on the bus", within(2, 3))),
    ("foreign_nmt", Stops("another master is on the bus", within(2, 3))),
    ("foreign_frame", Stops("another master is on the bus", within(2, 3))),
    ("link_loss", EndsReflection("no new wrench from the commanded side", [1, 70])),
    ("link_frozen", EndsReflection("no new wrench from the commanded side", [1, 70])),
    ("link_foreign", EndsReflection("no new wrench from the commanded side", [1, 70])),
    ("link_slow", EndsReflection("take 9.0 ms or more, remote.link.round_trip_ms is 5.0", [0, 70])),
    ("far_side_holds", EndsReflection("the far side holds: force sensor silent", [0, 70])),
];

/// Result of one run.
#[derive(Debug)]
struct Run {
    last: Record,
    /// Cycles from the fault on.
    torque: Within,
    /// The last engaged cycle after the fault.
    engaged: u64,
    /// Number of cycles until only gravity compensation acts.
    reflecting: u64,
}

/// Plays a scenario to its end, or for 150 cycles after a stop. No target may exceed its limit.
fn play(config: &Config, script: &Scenario) -> Run {
    let most = most(config);
    let mut bench = started(config, script.clone(), ());
    let begun = bench.node().bus().stations().scenario_start().unwrap();
    let fault = begun + script.faults()[0].start;
    let (mut torque, mut reflecting) = (within(0, 0), 0);
    let (mut stopped, mut engaged) = (0, 0);
    loop {
        let record = bench.cycle();
        let is_within = record.targets.iter().zip(most).all(|(target, most)| target.abs() <= most);
        assert!(is_within, "{:?}", record.targets);
        let cycles = record.at.since(fault).as_micros() / config.period.as_micros();
        let cycles = u64::try_from(cycles).unwrap();
        if record.targets != [0; 6] {
            torque.zero = cycles;
        }
        if (record.output.tau - record.output.ledger.gravity).amax() > 1e-9 {
            reflecting = cycles;
        }
        if has_torque(config, &bench.world_mut().torques()) {
            torque.torque_free = cycles;
        }
        if record.mode == Mode::Engaged {
            engaged = cycles;
        }
        stopped += u64::from(record.mode.is_stopped());
        if stopped == 150 || bench.elapsed().as_secs_f64() >= script.seconds() {
            return Run { last: record, torque, engaged, reflecting };
        }
    }
}

/// Returns whether a joint exerts more than a hundredth of its largest torque: a current decays without an end.
fn has_torque(config: &Config, torques: &SVector<f64, 6>) -> bool {
    let mut joints = config.joints.iter().zip(torques);
    joints.any(|(joint, torque)| torque.abs() > 0.01 * joint.plant.actuator.max_torque)
}

/// Returns the largest target of each drive, in ‰ of its rated torque.
fn most(config: &Config) -> [i16; 6] {
    config.joints.each_ref().map(|joint| {
        let [c1, c3, c5] = joint.plant.actuator.torque_curve;
        let t = joint.plant.actuator.max_torque;
        let per_mille = (c1 * t + c3 * t.powi(3) + c5 * t.powi(5)).round();
        i16::try_from(format!("{per_mille:.0}").parse::<i64>().unwrap()).unwrap()
    })
}

fn holds(file: &str, rows: &[(&str, Node)]) {
    let config = config(file);
    for (name, node) in rows {
        let Run { last, torque, engaged, reflecting } =
            play(&config, &scenario(&format!("faults/{name}")));
        let cause = last.cause.map_or_else(String::new, |cause| cause.to_string());
        match node {
            Stops(because, within) => {
                assert!(cause.contains(because), "{name}: {cause}");
                let is_soon =
                    torque.zero <= within.zero && torque.torque_free <= within.torque_free;
                assert!(is_soon, "{name}: {torque:?}");
            }
            Disengages(within) => {
                assert_eq!((last.mode, &*cause), (Mode::Armed, ""), "{name}");
                assert!(engaged <= *within, "{name}: {engaged}");
            }
            EndsReflection(because, [least, most]) => {
                assert!(cause.contains(because), "{name}: {cause}");
                assert_eq!(last.mode, Mode::ReflectionOff, "{name}");
                assert!((*least..=*most).contains(&reflecting), "{name}: {reflecting} cycles");
            }
            GoesOn(why) => {
                assert_eq!((last.mode, &*cause), (Mode::Engaged, ""), "{name}: {why}");
            }
        }
    }
}

#[test]
fn broken_drive_stops_all() {
    holds(KRAFT, DRIVES);
}

#[test]
fn lost_or_malformed_frames_stop_all_drives() {
    holds(KRAFT, FRAMES);
}

#[test]
fn wrong_measurements_stop_all_and_a_bouncing_deadman_does_not() {
    holds(KRAFT, SENSES);
}

#[test]
fn foreign_frame_stops_all_and_an_old_wrench_ends_reflection() {
    holds(KRAFT, FOREIGN);
}

#[test]
fn another_arm_with_other_frames_stops_for_the_same_causes() {
    let same = ["unplug", "rpdo_lost", "foreign_nmt"];
    let is_same = |row: &&(&str, Node)| same.contains(&row.0);
    let rows: Vec<_> = [DRIVES, FRAMES, FOREIGN].concat();
    let rows: Vec<_> = rows.iter().filter(is_same).copied().collect();
    assert_eq!(rows.len(), same.len());
    holds(JPL, &rows);
    // The wire is the second bus, with all of its drives.
    holds(JPL, &[("wire_cut", Stops("bus 1: no sample of any drive for 3 cycles", within(5, 6)))]);
}

#[test]
fn every_scenario_of_a_fault_is_in_the_table() {
    let files = Path::new("config/scenarios/faults").read_dir().unwrap();
    let stem = |path: &Path| path.file_stem().unwrap().to_str().unwrap().to_owned();
    let mut files: Vec<_> = files.map(|file| stem(&file.unwrap().path())).collect();
    files.sort();
    let mut names: Vec<_> =
        [DRIVES, FRAMES, SENSES, FOREIGN].concat().iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    assert_eq!(files, names);
}

#[test]
fn scenario_applies_faults_of_host_bus_and_link() {
    let text = fs::read_to_string("config/scenarios/faults/link_loss.toml").unwrap();
    let (operator, _) = text.split_once("[[fault]]").unwrap();
    for (keys, target, cause) in [
        ("kind = \"process_stopped\"\nfor_s = 0.05", Target::Host, cause::CauseKind::Overrun),
        ("kind = \"host_suspended\"\nfor_s = 0.1", Target::Host, cause::CauseKind::Suspended),
        ("kind = \"interface_down\"", Target::Bus(Channel(0)), cause::CauseKind::BusDown),
        ("kind = \"sensed_force\"\nforce_n = nan", Target::Link, cause::CauseKind::LinkLost),
    ] {
        let text = format!("{operator}[[fault]]\nat_s = 1.0\n{keys}\n");
        let mut bench = Bench::new(&config(KRAFT), script(&text), 1, ());
        bench.bring_up().unwrap();
        let mut last = bench.cycle();
        while bench.elapsed() < Duration::from_millis(1_250) {
            let is_before = bench.elapsed() < Duration::from_millis(998);
            last = bench.cycle();
            assert!(!is_before || last.cause.is_none(), "{keys}: {:?}", last.cause);
        }
        assert_eq!(last.cause.map(|it| it.kind()), Some(cause), "{keys}");
        let notice = bench.fault_notice().unwrap();
        assert_eq!(
            (notice.fault.target, notice.at, notice.is_over),
            (target, Duration::from_secs(1), false)
        );
    }
}

/// The frames of a run of 1.2 s, in which the node is armed.
fn frames_of(faults: &str, seed: u64) -> Wire {
    let text = "seconds = 2\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n".to_owned() + faults;
    let wire = Wire::default();
    let mut bench = Bench::new(&config(KRAFT), script(&text), seed, wire.clone());
    bench.bring_up().unwrap();
    bench.run(1_200);
    wire
}

#[test]
fn scenario_and_seed_are_one_run_bit_for_bit() {
    let some =
        "[[fault]]\nat_s = 0.3\nkind = \"drop\"\njoint = 3\nframe = \"tpdo1\"\nshare = 0.1\n";
    let all = |seed| frames_of(some, seed).all();
    assert_eq!(all(1), all(1));
    assert_ne!(all(1), all(2));
}

#[test]
fn fault_that_selects_no_frame_changes_nothing() {
    let never = "[[fault]]\nat_s = 0.3\nkind = \"drop\"\njoint = \"all\"\ncob_id = 0x7E5\n";
    assert_eq!(frames_of(never, 1).all(), frames_of("", 1).all());
}

#[test]
fn wrapping_counter_is_no_fault() {
    // As the arm is at the start, the elbow's counter is 300 before its end.
    let text = fs::read_to_string(KRAFT).unwrap();
    let zero = i32::MAX - 300 - 95 * 36 * 16_384 / 360;
    let wrapping = text.replace("zero_counts = -3400\n", &format!("zero_counts = {zero}\n"));
    assert_ne!(text, wrapping);
    let script = Scenario::parse(
        "seconds = 3\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
        [[switch]]\nat_s = 0.3\ndeadman = true\n\
        [[move]]\nat_s = 0.4\nduration_s = 0.3\nto_m = [0.04, 0.0, 0.0]\n\
        [[move]]\nat_s = 0.7\nduration_s = 0.3\nto_m = [-0.04, 0.0, 0.0]\n",
    )
    .unwrap();
    let run = |text: &str| -> Vec<([i16; 6], i32)> {
        let config = parse(KRAFT, text);
        let mut bench = started(&config, script.clone(), ());
        let cycle = |_| {
            let targets = bench.cycle().targets;
            let drive = bench.world_mut().drive_mut(Joint::of::<3>()).unwrap();
            let counts = drive.dictionary().get(Object::POSITION_ACTUAL).unwrap();
            (targets, i32::from_le_bytes(counts.try_into().unwrap()))
        };
        (0..1_000).map(cycle).collect()
    };
    let (plain, wrapping) = (run(&text), run(&wrapping));
    let is_beyond = |(_, counts): &([i16; 6], i32)| *counts < 0;
    assert!(wrapping.iter().any(is_beyond) && !wrapping.iter().all(is_beyond));
    for ((plain, _), (wrapping, _)) in plain.iter().zip(&wrapping) {
        // Other bytes take other times on the wire, by some bits.
        let apart = plain.iter().zip(wrapping).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(apart <= 3, "{plain:?} {wrapping:?}");
    }
}

#[test]
fn lost_link_freezes_the_object_until_it_is_back() {
    let script = scenario("faults/link_loss");
    let mut bench = started(&config(KRAFT), script, ());
    let (mut known, mut lost) = (None, 0);
    for _ in 0..1_700 {
        let link = bench.world_mut().link();
        let record = bench.cycle();
        if link == Some(LinkFault::Lost) {
            lost += 1;
            assert_eq!(record.x_b_m, *known.get_or_insert(record.x_b_m));
        }
    }
    assert!((498..=502).contains(&lost), "{lost}");
    assert_ne!(Some(bench.cycle().x_b_m), known, "the hand has gone on");
}
