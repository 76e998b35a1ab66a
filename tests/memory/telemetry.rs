//! Telemetry of simulated runs: its lines against the records and frames that they are made of, in each shipped configuration.

use std::cell::RefCell;
use std::rc::Rc;

use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3};

use crate::common::prelude::*;
use bus::Tap;
use config::robots::RobotArm;
use telemetry::feed::{Feed, FeedLine, Scarce, Source};
use telemetry::origin::Origin;
use telemetry::timing::Timing;
use testbench::bench::Course;
use testbench::robot_site::{Equipment, RobotSite};
use testbench::side::Side;

const CONFIGS: [&str; 5] =
    ["jpl_like", "jpl_like_1538hz", "kraft_like", "kraft_like_500hz", "sixr_spherical"];

/// Difference of a number and the same one read from JSON.
const ROUNDING: f64 = 1e-12;

/// Passes frames on to a feed.
#[derive(Clone)]
struct FeedTap(Rc<RefCell<Feed>>, Rc<RefCell<Vec<Value>>>);

impl FeedTap {
    fn take(&self, line: Option<FeedLine>) {
        let Some(line) = line else { return };
        let (FeedLine::Mode(text) | FeedLine::Snapshot(text)) = line;
        assert!(text.len() < 32_000 && text.ends_with('\n') && text.matches('\n').count() == 1);
        self.1.borrow_mut().push(serde_json::from_str(&text).unwrap());
    }
}

impl Tap for FeedTap {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        let line = self.0.borrow_mut().on_frame(at, telegram);
        self.take(line);
    }

    fn on_event(&mut self, _: Instant, event: Event) -> Option<Event> {
        Some(event)
    }
}

/// A run with its telemetry.
struct RunWithFeed {
    bench: Bench<FeedTap>,
    watched: FeedTap,
    timing: Timing,
}

impl RunWithFeed {
    fn new(config: &Config, side: Side, scenario: &str) -> Self {
        let mut feed = Feed::new(config, Source::Demo, None);
        feed.set_read(true);
        let watched = FeedTap(Rc::new(RefCell::new(feed)), Rc::default());
        let scenario = script(scenario);
        let course = Course { scenario, seed: 1, speed: None };
        let mut bench = Bench::recorded(config, side, course, watched.clone(), ());
        bench.bring_up().unwrap();
        Self { bench, watched, timing: Timing::default() }
    }

    fn cycle(&mut self) -> Record {
        let record = self.bench.cycle();
        self.add(&record);
        record
    }

    fn add(&mut self, record: &Record) {
        self.timing.add(record);
        let scarce = || Scarce { timing: Some(self.timing.report()), ..Scarce::default() };
        let lines = self.watched.0.borrow_mut().on_record(record, scarce);
        lines.into_iter().for_each(|line| self.watched.take(line));
    }

    fn lines(&self, kind: &str) -> Vec<Value> {
        let lines = self.watched.1.borrow();
        lines.iter().filter(|line| line["kind"] == kind).cloned().collect()
    }

    fn description(&self) -> Value {
        serde_json::from_str(self.watched.0.borrow().description()).unwrap()
    }
}

fn shipped(scenario: &str) -> String {
    fs::read_to_string(format!("config/scenarios/{scenario}.toml")).unwrap()
}

fn six(value: &Value) -> SVector<f64, 6> {
    let numbers = value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap());
    SVector::<f64, 6>::from_iterator(numbers)
}

fn pose(value: &Value) -> Isometry3<f64> {
    let of = |key: &str, at: usize| value[key][at].as_f64().unwrap();
    let [x, y, z] = [0, 1, 2].map(|at| of("position", at));
    let [w, i, j, k] = [0, 1, 2, 3].map(|at| of("quaternion", at));
    let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

/// Forward kinematics of described joints: Craig's modified Denavit-Hartenberg parameters.
fn forward(joints: &Value, q: &Value) -> Isometry3<f64> {
    let joints = joints.as_array().unwrap().iter().zip(q.as_array().unwrap());
    joints.fold(Isometry3::identity(), |chain, (joint, q)| {
        let of = |key: &str| joint[key].as_f64().unwrap();
        let (q, slides) = (q.as_f64().unwrap(), joint["kind"] == "prismatic");
        let (turn, slide) = if slides { (0.0, q) } else { (q, 0.0) };
        let about = |axis: Vector3<f64>, angle: f64| Isometry3::rotation(axis * angle);
        chain
            * about(Vector3::x(), of("alpha"))
            * Isometry3::translation(of("a"), 0.0, 0.0)
            * about(Vector3::z(), of("theta") + turn)
            * Isometry3::translation(0.0, 0.0, of("d") + slide)
    })
}

fn near(found: &Isometry3<f64>, expected: &Isometry3<f64>) -> bool {
    let off = found.inverse() * expected;
    off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-7
}

#[test]
fn snapshots_come_by_cycle_and_have_its_record() {
    for name in CONFIGS {
        let config = config(&format!("config/{name}.toml"));
        let mut shown =
            RunWithFeed::new(&config, Side::from_config(&config), &shipped("teleoperation"));
        let every = shown.description()["cycles_per_snapshot"].as_u64().unwrap();
        let apart = config.period.as_secs_f64() * f64::from(u32::try_from(every).unwrap());
        assert!((apart - 0.02).abs() <= 0.5 * config.period.as_secs_f64(), "{name}: {apart} s");
        let records: Vec<_> = (0..40 * every).map(|_| shown.cycle()).collect();
        let snapshots = shown.lines("snapshot");
        assert_eq!(snapshots.len(), 40, "{name}");
        let joints = &shown.description()["hand"]["joints"];
        for snapshot in &snapshots {
            let cycle = snapshot["cycle"].as_u64().unwrap();
            let place = records.iter().position(|record| record.cycle == cycle).unwrap();
            let record = &records[place];
            let output = &record.output;
            assert_eq!(cycle % every, 0, "{name}");
            assert_eq!(snapshot["mode"], record.mode.name(), "{name}");
            assert_eq!(snapshot["at_us"].as_u64(), Some(record.at.as_micros()), "{name}");
            assert!((six(&snapshot["tau"]) - output.tau).amax() < ROUNDING, "{name}");
            let f_s = SVector::<f64, 6>::from(record.f_s.components());
            assert!((six(&snapshot["f_s"]) - f_s).amax() < ROUNDING, "{name}");
            let grip =
                forward(joints, &snapshot["q"]) * pose(&shown.description()["hand"]["x_6_g"]);
            assert!(near(&grip, &output.x_0_g), "{name}: {grip}");
            assert!(near(&pose(&snapshot["x_0_g"]), &output.x_0_g), "{name}");
            assert!(near(&pose(&snapshot["x_b_m"]), &record.x_b_m), "{name}");
            let begin = (place + 1).saturating_sub(usize::try_from(every).unwrap());
            let span = &records[begin..=place];
            let bounds = &snapshot["spans"]["tau"];
            let (min, max) = (six(&bounds["min"]), six(&bounds["max"]));
            for joint in 0..6 {
                let of_joint = || span.iter().map(|record| record.output.tau[joint]);
                let least = of_joint().fold(f64::INFINITY, f64::min);
                let most = of_joint().fold(f64::NEG_INFINITY, f64::max);
                assert!((min[joint] - least).abs() < ROUNDING, "{name}");
                assert!((max[joint] - most).abs() < ROUNDING, "{name}");
            }
        }
    }
}

#[test]
fn felt_wrench_is_that_of_torques_beyond_the_arms_own() {
    let config = config(KRAFT);
    let mut shown =
        RunWithFeed::new(&config, Side::from_config(&config), &shipped("teleoperation"));
    let mut pressed = 0;
    for _ in 0..12_000 {
        let record = shown.cycle();
        let lines = shown.lines("snapshot");
        shown.watched.1.borrow_mut().clear();
        let Some(snapshot) = lines.first() else { continue };
        let output = &record.output;
        let felt = six(&snapshot["f_g"]);
        let torques = output.j_g.matrix().transpose() * felt;
        let expected = if record.mode == Mode::Engaged || record.mode == Mode::Armed {
            output.tau - output.ledger.carried()
        } else {
            SVector::<f64, 6>::zeros()
        };
        assert!((torques - expected).amax() < 1e-9, "{torques} {expected}");
        pressed += usize::from(felt.fixed_rows::<3>(0).norm() > 2.2);
    }
    assert!(pressed > 20, "contact was felt in {pressed} snapshots");
}

#[test]
fn robot_stands_where_its_joints_bring_its_tool() {
    for file in [PUMA, "config/robots/eight_r_synthetic.toml"] {
        let config = config(KRAFT).with_robot(RobotArm::load(Path::new(file)).unwrap());
        let site = RobotSite::new(&config, &Equipment::from_remote(&config.remote), 1).unwrap();
        let sides = [Side::from(site), Side::from_config(&config)];
        for side in sides {
            let mut shown = RunWithFeed::new(&config, side, &shipped("teleoperation"));
            (0..5_000).for_each(|_| _ = shown.cycle());
            let robot = &shown.description()["robot"];
            let snapshots = shown.lines("snapshot");
            let moved = pose(&snapshots[0]["x_b_m"]).inverse() * pose(&snapshots[249]["x_b_m"]);
            assert!(moved.translation.vector.norm() > 0.01, "{file}");
            for snapshot in &snapshots {
                let chain = forward(&robot["joints"], &snapshot["q_r"]);
                let tool = pose(&robot["x_b_0"]) * chain * pose(&robot["x_n_m"]);
                let off = tool.inverse() * pose(&snapshot["x_b_m"]);
                assert!(off.translation.vector.norm() < 1e-6, "{file}: {off}");
            }
        }
    }
}

#[test]
fn mode_line_comes_at_each_change_and_twice_a_second() {
    let config = config(KRAFT);
    let mut shown =
        RunWithFeed::new(&config, Side::from_config(&config), &shipped("faults/unplug"));
    let mut changes = Vec::new();
    let mut last = (Mode::Boot, None);
    for _ in 0..4_000 {
        let record = shown.cycle();
        if (record.mode, record.cause) != last {
            last = (record.mode, record.cause);
            changes.push((record.cycle, record.mode));
        }
    }
    let lines = shown.lines("mode");
    for (cycle, mode) in &changes {
        let line = lines.iter().find(|line| line["cycle"].as_u64() == Some(*cycle)).unwrap();
        assert_eq!(line["mode"], mode.name());
    }
    let times = lines.iter().filter(|line| line["cycle"].as_u64() > Some(0));
    let times: Vec<_> = times.map(|line| line["at_us"].as_u64().unwrap()).collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] <= 500_000), "{times:?}");
    let stopped = lines.last().unwrap();
    assert!(stopped["stopped_by"].as_str().unwrap().starts_with("joint 3 (elbow)"), "{stopped:#}");
    let way_out = stopped["way_out"].as_array().unwrap();
    assert!(way_out.iter().any(|step| step.as_str().unwrap().contains("frhc ctl reset")));
    let latest = shown.lines("snapshot");
    assert_eq!(latest.last().unwrap()["stopped_by"], stopped["stopped_by"]);
    let missing = |snapshot: &Value| snapshot["watchdogs"][0]["value"].as_f64().unwrap();
    let worst = latest.iter().map(missing).fold(0.0, f64::max);
    assert!(worst >= 3.0, "three samples missing in a row stop: {worst}");
}

#[test]
fn loads_and_timing_are_those_of_the_run() {
    for name in CONFIGS {
        let config = config(&format!("config/{name}.toml"));
        let mut shown = RunWithFeed::new(&config, Side::from_config(&config), "seconds = 3\n");
        let before = shown.bench.carried();
        let begun = shown.bench.now();
        while shown.bench.now().since(begun).as_secs_f64() < 3.0 {
            shown.cycle();
        }
        let after = shown.bench.carried();
        let snapshot = shown.lines("snapshot").pop().unwrap();
        let buses = snapshot["buses"].as_array().unwrap();
        assert_eq!(buses.len(), after.len(), "{name}");
        for (bus, (after, before)) in buses.iter().zip(after.iter().zip(&before)) {
            let frames = f64::from(u32::try_from(after.frames - before.frames).unwrap()) / 3.0;
            let found = bus["frames_per_s"].as_f64().unwrap();
            assert!((found / frames - 1.0).abs() < 0.02, "{name}: {found} {frames}");
            assert!(bus["load_percent"].as_f64().unwrap() > 20.0, "{name}: {bus}");
        }
        let samples = &snapshot["timing"]["sync_to_last_sample_us"];
        assert!(samples["count"].as_u64().unwrap() > 1_000, "{name}: {samples}");
        for watchdog in snapshot["watchdogs"].as_array().unwrap() {
            let of = |key: &str| watchdog[key].as_f64().unwrap();
            assert!(of("value") < of("limit"), "{name}: {watchdog}");
        }
        assert_eq!(snapshot["watchdogs"].as_array().unwrap().len(), 4, "{name}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_null() {
    let config = config(KRAFT);
    let mut shown = RunWithFeed::new(&config, Side::from_config(&config), "seconds = 1\n");
    let mut record = shown.cycle();
    while record.cycle % 20 != 19 {
        record = shown.cycle();
    }
    record.cycle += 1;
    record.f_s.force.x = f64::NAN;
    record.output.tau[2] = f64::INFINITY;
    shown.add(&record);
    let snapshot = shown.lines("snapshot").pop().unwrap();
    assert!(snapshot["f_s"][0].is_null() && snapshot["tau"][2].is_null(), "{snapshot}");
    assert!(snapshot["f_s"][1].is_number());
}

#[test]
fn no_snapshot_is_made_without_readers() {
    let config = config(KRAFT);
    let mut shown = RunWithFeed::new(&config, Side::from_config(&config), "seconds = 1\n");
    shown.watched.1.borrow_mut().clear();
    for _ in 0..1_000 {
        shown.watched.0.borrow_mut().set_read(false);
        shown.cycle();
    }
    assert_eq!(shown.lines("snapshot").len(), 0);
    let modes: Vec<_> = shown.lines("mode").iter().map(|line| line["mode"].clone()).collect();
    assert_eq!(modes, ["ready"], "the next reader gets the newest of these");
}

#[test]
fn boot_has_no_cycles_and_yet_a_mode_line() {
    let config = config(KRAFT);
    let mut feed =
        Feed::new(&config, Source::Run, Some(Origin::from_micros(1_795_331_563_123_456)));
    let description: Value = serde_json::from_str(feed.description()).unwrap();
    assert_eq!(description["started_at"], "2026-11-22T07:12:43.123Z");
    let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x701, [0x7F]) };
    feed.set_read(true);
    let at = |millis: u64| Instant::from_micros(1_000 * millis);
    let due = (0..=3_000).filter(|millis| feed.on_frame(at(*millis), &telegram).is_some());
    assert_eq!(due.collect::<Vec<_>>(), [500, 1_000, 1_500, 2_000, 2_500, 3_000]);
    let mode: Value = serde_json::from_str(&feed.mode()).unwrap();
    assert_eq!((&mode["mode"], &mode["stopped_by"]), (&"boot".into(), &Value::Null));
    assert!(mode["way_out"][0].as_str().unwrap().starts_with("Wait"), "{mode}");
}
