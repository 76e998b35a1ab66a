//! Every script in config/scenarios/faults: what the node does of it, and what it does not see.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::path::Path;

use nalgebra::SVector;

use crate::common::bench::Wire;
use crate::common::bench::config;
use crate::common::bench::scenario;
use canopen::object::Object;
use config::Config;
use lab::bench::Bench;
use node::record::Mode;
use node::record::Record;
use sim::scenario::Scenario;
use sim::scenario::fault::Link;

const KRAFT: &str = "config/kraft_like.toml";
const JPL: &str = "config/jpl_like.toml";

/// What the node does of a fault.
#[derive(Clone, Copy, Debug)]
enum Node {
    /// It stops for a cause that says this, and tells every drive zero torque within so many cycles of the
    /// fault; from when on no drive pushes.
    Stops(&'static str, Within),
    /// It is armed, not engaged, within so many cycles, and stays so until the operator presses anew.
    Disengages(u64),
    /// It ends reflection for a cause that says this, and within so many cycles of the fault tells the drives
    /// no more than the weight of the arm, which it carries on.
    Carries(&'static str, u64),
    /// It goes on, and should: what becomes of it is bounded, and why.
    Bears(&'static str),
}

/// In cycles since the fault.
#[derive(Clone, Copy, Debug)]
struct Within {
    /// Until every drive is told zero torque.
    told: u64,
    /// Until none has any.
    gone: u64,
}

const fn within(told: u64, gone: u64) -> Within {
    Within { told, gone }
}

use Node::Bears;
use Node::Carries;
use Node::Disengages;
use Node::Stops;

use units::numbering::Joint;

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
    ("delay", Bears("a constant lateness cannot be told from none, and moves little: 4")),
    ("reorder", Bears("a late sample never replaces a newer one: 4")),
    ("duplicate", Stops("joint 3: two nodes seem to have its node-id", within(3, 4))),
    ("impersonate", Stops("joint 3: two nodes seem to have its node-id", within(3, 4))),
    ("freeze", Stops("joint 2: its position stands still under torque", within(505, 506))),
    ("corrupt", Bears("a single sample that cannot be is not believed: 12")),
];

const SENSES: &[(&str, Node)] = &[
    ("encoder_jump", Stops("joint 3: its position jumped", within(3, 4))),
    ("encoder_frozen", Stops("joint 2: its position stands still under torque", within(505, 506))),
    // It tells its torque at every 99th SYNC here, and the second time counts.
    ("torque_actual_scale", Stops("joint 2: its drive exerts another torque", within(201, 202))),
    // The hand opens the deadman 300 ms after its contact sticks.
    ("deadman_stuck", Stops("the deadman's channels contradict each other", within(352, 353))),
    // The first bounce comes at random, here in the third cycle; it does not engage again by itself.
    ("deadman_bounce", Disengages(5)),
];

const STRANGERS: &[(&str, Node)] = &[
    ("foreign_sync", Stops("another master is on the bus", within(2, 3))),
    ("foreign_nmt", Stops("another master is on the bus", within(2, 3))),
    ("foreign_frame", Stops("another master is on the bus", within(2, 3))),
    ("link_loss", Carries("no new wrench from the commanded side", 70)),
    ("link_frozen", Carries("no new wrench from the commanded side", 70)),
];

/// What one run came to.
#[derive(Debug)]
struct Run {
    last: Record,
    /// In cycles from the fault on.
    torque: Within,
    /// The last cycle that was engaged, likewise.
    engaged: u64,
    /// Until only the weight of the arm is told.
    felt: u64,
}

/// Plays a script to its end, or for 150 cycles after a stop. No drive is ever told more than it may be.
fn play(config: &Config, script: &Scenario) -> Run {
    let most = most(config);
    let mut bench = Bench::new(config, script.clone(), 1, false, ());
    bench.bring_up().unwrap();
    let begun = bench.node().bus().stations().scenario_start().unwrap();
    let fault = begun + script.faults()[0].begins;
    let (mut torque, mut felt) = (within(0, 0), 0);
    let (mut stopped, mut engaged) = (0, 0);
    loop {
        let record = bench.cycle();
        let is_within = record.targets.iter().zip(most).all(|(told, most)| told.abs() <= most);
        assert!(is_within, "{:?}", record.targets);
        let cycles = record.at.since(fault).as_micros() / config.period.as_micros();
        let cycles = u64::try_from(cycles).unwrap();
        if record.targets != [0; 6] {
            torque.told = cycles;
        }
        if (record.output.tau - record.output.ledger.gravity).amax() > 1e-9 {
            felt = cycles;
        }
        if is_pushed(config, &bench.world_mut().torques()) {
            torque.gone = cycles;
        }
        if record.mode == Mode::Engaged {
            engaged = cycles;
        }
        stopped += u64::from(record.mode.is_stopped());
        if stopped == 150 || bench.elapsed().as_secs_f64() >= script.seconds() {
            return Run { last: record, torque, engaged, felt };
        }
    }
}

/// Whether a joint has more than a hundredth of the torque it may have: a current dies away, and is never
/// quite gone.
fn is_pushed(config: &Config, torques: &SVector<f64, 6>) -> bool {
    let mut joints = config.joints.iter().zip(torques);
    joints.any(|(joint, torque)| torque.abs() > 0.01 * joint.plant.actuator.max_torque)
}

/// The most each drive may be told, in ‰ of its rated torque.
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
        let Run { last, torque, engaged, felt } =
            play(&config, &scenario(&format!("faults/{name}")));
        let cause = last.cause.map_or_else(String::new, |cause| cause.to_string());
        match node {
            Stops(because, within) => {
                assert!(cause.contains(because), "{name}: {cause}");
                let is_soon = torque.told <= within.told && torque.gone <= within.gone;
                assert!(is_soon, "{name}: {torque:?}");
            }
            Disengages(within) => {
                assert_eq!((last.mode, &*cause), (Mode::Armed, ""), "{name}");
                assert!(engaged <= *within, "{name}: {engaged}");
            }
            Carries(because, within) => {
                assert!(cause.contains(because), "{name}: {cause}");
                assert_eq!(last.mode, Mode::ReflectionOff, "{name}");
                assert!((1..=*within).contains(&felt), "{name}: felt for {felt} cycles");
            }
            Bears(why) => {
                assert_eq!((last.mode, &*cause), (Mode::Engaged, ""), "{name}: {why}");
            }
        }
    }
}

#[test]
fn a_drive_that_breaks_stops_all() {
    holds(KRAFT, DRIVES);
}

#[test]
fn frames_that_are_lost_or_cannot_be_stop_all_and_late_ones_are_borne() {
    holds(KRAFT, FRAMES);
}

#[test]
fn what_is_sensed_wrongly_stops_all_but_a_deadman_that_bounces() {
    holds(KRAFT, SENSES);
}

#[test]
fn a_stranger_stops_all_and_an_old_wrench_ends_reflection() {
    holds(KRAFT, STRANGERS);
}

#[test]
fn another_arm_with_other_frames_stops_for_the_same() {
    let same = ["unplug", "rpdo_lost", "foreign_nmt"];
    let is_same = |row: &&(&str, Node)| same.contains(&row.0);
    let rows: Vec<_> = [DRIVES, FRAMES, STRANGERS].concat();
    let rows: Vec<_> = rows.iter().filter(is_same).copied().collect();
    assert_eq!(rows.len(), same.len());
    holds(JPL, &rows);
    // The wire is the second bus, with all of its drives.
    holds(JPL, &[("wire_cut", Stops("bus 1: no sample of any drive for 3 cycles", within(5, 6)))]);
}

#[test]
fn every_script_of_a_fault_is_in_the_table() {
    let files = Path::new("config/scenarios/faults").read_dir().unwrap();
    let stem = |path: &Path| path.file_stem().unwrap().to_str().unwrap().to_owned();
    let mut files: Vec<_> = files.map(|file| stem(&file.unwrap().path())).collect();
    files.sort();
    let mut names: Vec<_> =
        [DRIVES, FRAMES, SENSES, STRANGERS].concat().iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    assert_eq!(files, names);
}

/// The frames of a run of 1.2 s, in which the node is armed.
fn frames_of(faults: &str, seed: u64) -> Wire {
    let text = "seconds = 2\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n".to_owned() + faults;
    let wire = Wire::default();
    let script = Scenario::parse(&text).unwrap();
    let mut bench = Bench::new(&config(KRAFT), script, seed, false, wire.clone());
    bench.bring_up().unwrap();
    bench.run(1_200);
    wire
}

#[test]
fn a_script_and_a_seed_are_one_run_bit_for_bit() {
    let some =
        "[[fault]]\nat_s = 0.3\nkind = \"drop\"\njoint = 3\nframe = \"tpdo1\"\nshare = 0.1\n";
    let all = |seed| frames_of(some, seed).all();
    assert_eq!(all(1), all(1));
    assert_ne!(all(1), all(2));
}

#[test]
fn a_fault_that_strikes_nothing_changes_nothing() {
    let never = "[[fault]]\nat_s = 0.3\nkind = \"drop\"\njoint = \"all\"\ncob_id = 0x7E5\n";
    assert_eq!(frames_of(never, 1).all(), frames_of("", 1).all());
}

#[test]
fn a_counter_that_wraps_is_no_fault() {
    // As the arm is at the start, the elbow's counter is 300 before its end.
    let text = std::fs::read_to_string(KRAFT).unwrap();
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
        let config = Config::parse(Path::new(KRAFT), text).unwrap();
        let mut bench = Bench::new(&config, script.clone(), 1, false, ());
        bench.bring_up().unwrap();
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
fn a_lost_link_brings_nothing_new_and_is_as_before_when_it_is_back() {
    let script = scenario("faults/link_loss");
    let mut bench = Bench::new(&config(KRAFT), script, 1, false, ());
    bench.bring_up().unwrap();
    let (mut known, mut lost) = (None, 0);
    for _ in 0..1_700 {
        let link = bench.world_mut().link();
        let record = bench.cycle();
        if link == Link::Lost {
            lost += 1;
            assert_eq!(record.x_b_m, *known.get_or_insert(record.x_b_m));
        }
    }
    assert!((498..=502).contains(&lost), "{lost}");
    assert_ne!(Some(bench.cycle().x_b_m), known, "the hand has gone on");
}
