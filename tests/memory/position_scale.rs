//! Position scale of a simulated drive against the joint angle of the node: `drive_encoder`, `drive_gear`, `drive_feed`.

use crate::common::prelude::*;

/// Arms immediately; closes the deadman 0.4 s after the first SYNC. The hand moves from then on.
const SCRIPT: &str = "seconds = 5\n\
    [[console]]\nat_s = 0.02\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.4\ndeadman = true\n\
    [[move]]\nat_s = 0.8\nduration_s = 0.5\nto_m = [0.05, 0.0, 0.0]\n";

/// Largest difference between the node's sample and the plant, half a period later, in rad.
const TOLERANCE: f64 = 2e-3;

/// Returns the arm with `keys` in place of the elbow's encoder_counts_per_rev. 1:1 in 608Fh verifies no scale, so that
/// is accepted, and the arm is weak.
fn arm(keys: &str) -> Config {
    let weak = KRAFT_500HZ_TEXT.replace("max_force_n = 40.0 ", "max_force_n = 5.0 ");
    let (before, elbow) = weak.split_once("name = \"elbow\"").unwrap();
    let keys = format!("accept_stated_only = [\"position_scale\"]\nrest_deg = 95.0\n{keys}");
    let elbow = elbow.replacen("encoder_counts_per_rev = 16384", &keys, 1);
    let text = format!("{before}name = \"elbow\"{elbow}");
    parse("config/test.toml", &text)
}

fn bench(keys: &str) -> Bench<Wire> {
    let scenario = script(SCRIPT);
    Bench::new(&arm(keys), scenario, 1, Wire::default())
}

/// Returns the elbow's angle in the node less that of the plant, in rad.
fn error(bench: &mut Bench<Wire>, record: &Record) -> f64 {
    record.output.q[ELBOW.index()] - bench.world_mut().plant().q()[ELBOW.index()]
}

#[test]
fn stated_factors_are_read_as_the_angle_of_the_joint() {
    for keys in [
        "encoder_counts_per_rev = 16384",
        // 608Fh, 6092h as usual: what the drive does before its gear.
        "encoder_counts_per_rev = 8192\ndrive_gear = [2, 1]",
        "encoder_counts_per_rev = 8192\ndrive_encoder = [16384, 1]\ndrive_gear = [2, 1]\ndrive_feed = [16384, 1]",
        "encoder_counts_per_rev = 8192\ndrive_encoder = [4096, 1]\ndrive_gear = [2, 1]",
        // Millidegrees of the joint, after a gear of 36.
        "encoder_counts_per_rev = 10000\ndrive_encoder = [65536, 1]\ndrive_gear = [36, 1]\ndrive_feed = [360000, 1]",
        // Factors that the drive does not use, and one that multiplies.
        "encoder_counts_per_rev = 16384\ndrive_encoder = [1, 1]\ndrive_feed = [1, 1]",
        "encoder_counts_per_rev = 32768\ndrive_encoder = [1, 1]\ndrive_gear = [1, 2]",
        "encoder_counts_per_rev = 8192\ndrive_gear = [2, 1]\ndrive_feed = [1, 1]",
        "encoder_counts_per_rev = 5000\ndrive_encoder = [1, 1]\ndrive_feed = [5, 1]",
        "encoder_counts_per_rev = 3333\ndrive_gear = [7, 3]",
        // Millidegrees of the shaft, by 60A8h.
        "encoder_counts_per_rev = 360000\ndrive_encoder = [16384, 1]\ndrive_position_unit = 0xFD410000",
        "encoder_counts_per_rev = 10000\ndrive_encoder = [65536, 1]\ndrive_gear = [36, 1]\ndrive_position_unit = 0xFD410000",
    ] {
        let mut bench = bench(keys);
        bench.bring_up().unwrap_or_else(|error| panic!("{keys}: {error}"));
        let record = until(&mut bench, |record| record.mode == Mode::Engaged);
        let start = record.output.q[ELBOW.index()];
        assert!(error(&mut bench, &record).abs() < TOLERANCE, "{keys}");
        let mut travel: f64 = 0.0;
        for _ in 0..800 {
            let record = bench.cycle();
            assert_eq!((record.mode, record.cause), (Mode::Engaged, None), "{keys}");
            let off = error(&mut bench, &record);
            assert!(off.abs() < TOLERANCE, "{keys}: {off} rad");
            travel = travel.max((record.output.q[ELBOW.index()] - start).abs());
        }
        assert!(travel > 0.1, "{keys}: the elbow moved by {travel} rad");
    }
}

#[test]
fn factors_that_contradict_the_counts_are_read_as_another_angle() {
    let keys = "encoder_counts_per_rev = 16384\ndrive_encoder = [16384, 1]\ndrive_gear = [2, 1]\ndrive_feed = [16384, 1]";
    let mut bench = bench(keys);
    bench.bring_up().unwrap();
    let record = bench.cycle();
    let angle = bench.world_mut().plant().q()[ELBOW.index()];
    assert!((record.output.q[ELBOW.index()] - angle / 2.0).abs() < TOLERANCE, "half of {angle}");
}

#[test]
fn gear_scales_the_usual_encoder_and_feed() {
    let refused = |keys: &str, quirk: &str| {
        let mut scenario = script(SCRIPT);
        scenario.quirks_mut().add(ELBOW, [quirk.parse().unwrap()]);
        let mut bench = Bench::new(&arm(keys), scenario, 1, Wire::default());
        bench.bring_up().map_or_else(|error| error.to_string(), |()| String::new())
    };
    let keys = "encoder_counts_per_rev = 8192\ndrive_gear = [2, 1]";
    // Without its gear in them they would be right for half the angle.
    let encoder = refused(keys, "stored:608Fh:1=8192");
    assert!(encoder.contains("608Fh) is 8192:1, expected 16384:1 or 1:1"), "{encoder}");
    let feed = refused(keys, "stored:6092h:1=8192");
    assert!(feed.contains("6092h) is 8192:1, expected 1:1 or 16384:1"), "{feed}");
}

#[test]
fn drive_that_counts_tenths_of_a_degree_is_refused() {
    let refusal = |config: &Config, quirk: &str| {
        let mut scenario = script(SCRIPT);
        scenario.quirks_mut().add(ELBOW, [quirk.parse().unwrap()]);
        let mut bench = Bench::new(config, scenario, 1, Wire::default());
        if let Err(error) = bench.bring_up() {
            return error.to_string();
        }
        let record = until(&mut bench, |record| record.mode == Mode::Armed);
        let angle = bench.world_mut().plant().q()[ELBOW.index()];
        format!(
            "armed: the elbow is at {angle} rad, and read as {}",
            record.output.q[ELBOW.index()]
        )
    };
    let nanotec = config("config/drives/nanotec_cl4e.toml");
    for config in [arm("encoder_counts_per_rev = 16384"), nanotec] {
        assert_eq!(
            refusal(&config, "stored:60A8h=FF410000h"),
            "joint 3 (elbow), node 3: position unit (60A8h) is FF410000h (10^-1 °), expected 00B50000h (increments): \
             set it with the maker's tool or [[joint.boot.write]], or state it as drive_position_unit and give \
             encoder_counts_per_rev in units of 6064h"
        );
    }
}

#[test]
fn drive_at_rest_holds_the_stated_factors() {
    let keys = "encoder_counts_per_rev = 10000\ndrive_encoder = [65536, 1]\ndrive_gear = [36, 1]\ndrive_feed = [360000, 1]";
    let mut bench = bench(keys);
    let dictionary = bench.world_mut().drive_mut(ELBOW).unwrap().dictionary().clone();
    for (object, value) in [
        (Object::ENCODER_INCREMENTS, 65_536),
        (Object::VELOCITY_INCREMENTS, 65_536),
        (Object::GEAR_MOTOR_REVOLUTIONS, 36),
        (Object::FEED, 360_000),
    ] {
        assert_eq!(dictionary.unsigned(object), value, "{object}");
    }
}
