//! Teleoperation on the in-memory bus, as the operator experiences it.

use crate::common::bench::{booted, until_contact};
use crate::common::prelude::*;
use telemetry::summary::Summary;

#[test]
fn minute_of_teleoperation_loses_no_sample() {
    let config = config(KRAFT);
    let mut bench = started(&config, scenario("teleoperation"), ());
    let mut summary = Summary::default();
    let mut modes = Vec::new();
    for _ in 0..60_000 {
        let record = bench.cycle();
        summary.add(&record);
        if modes.last() != Some(&record.mode) {
            modes.push(record.mode);
        }
    }
    use Mode::{Armed, Engaged, Ready};
    let spells = [Ready, Armed, Engaged, Armed, Engaged, Armed, Engaged, Armed, Ready];
    assert_eq!(modes, spells);
    assert_eq!(summary.missing_samples, 0);
    assert!((1.0..6.0).contains(&summary.peak_felt_force_n), "{summary}");
    assert!(summary.contact_seconds > 5.0, "{summary}");
    assert!(summary.rate_tracking_rms_m_per_s < 2e-3, "{summary}");
    assert!(summary.pose_tracking_rms_m < 2e-3, "{summary}");
    for bus in bench.carried() {
        assert!((50.0..90.0).contains(&bus.percent), "{bus:?}");
    }
    bench.shut_down().unwrap();
}

#[test]
fn seed_alone_determines_the_frames() {
    let run = |seed| {
        let config = config(KRAFT);
        let wire = Wire::default();
        let mut bench = Bench::new(&config, scenario("contact_10s"), seed, wire.clone());
        bench.bring_up().unwrap();
        bench.run(4_000);
        wire.transcript(usize::MAX)
    };
    let (first, again, other) = (run(1), run(1), run(2));
    assert!(first == again, "equal seeds, different frames");
    assert!(first != other, "different seeds, equal frames");
}

#[test]
fn wall_pushes_the_hand_against_its_motion() {
    let (mut bench, _) = booted(KRAFT, "contact_10s");
    let record = until_contact(&mut bench);
    let f_0 = record.output.x_0_g.rotation * record.output.f_g_task.force;
    // The hand and the object move along +x; the reflected force is along -x.
    assert!(f_0.x < -0.5 && f_0.x.abs() > 10.0 * f_0.y.abs().max(f_0.z.abs()), "{f_0}");
}

#[test]
fn deadman_release_stops_object_and_reflection_in_a_cycle() {
    let (mut bench, _) = booted(KRAFT, "contact_10s");
    until_contact(&mut bench);
    let record = until(&mut bench, |record| record.mode == Mode::Armed);
    assert_eq!(record.output.command, Motion::Hold);
    assert!(record.output.f_g_task.force.norm() < 1e-12);
    assert!(
        (record.output.tau - record.output.ledger.gravity).norm() < 1e-12,
        "gravity compensation goes on"
    );
}

#[test]
fn targets_are_zero_unless_armed() {
    let (mut bench, _) = booted(KRAFT, "contact_10s");
    for _ in 0..12_000 {
        let record = bench.cycle();
        if !matches!(record.mode, Mode::Armed | Mode::Engaged) {
            assert_eq!(record.targets, [0; 6]);
        }
    }
}

#[test]
fn sync_counter_and_time_stamp_are_sent_if_configured() {
    let keys = "[node]\nsync_counter = 4\ntime_period_ms = 100\n";
    let text = include_str!("../../config/kraft_like.toml").replacen("[node]\n", keys, 1);
    let text = text.replace("load_limit_percent = 90", "load_limit_percent = 91");
    let config = parse(KRAFT, &text);
    let wire = Wire::default();
    let mut bench = started(&config, scenario("contact_10s"), wire.clone());
    let from = bench.cycle().at;
    bench.run(400);
    let counts: Vec<u8> = wire.since(from, 0x80).iter().map(|(_, sync)| sync.data()[0]).collect();
    assert!(counts.len() >= 400);
    assert!(counts.windows(2).all(|pair| pair[1] == pair[0] % 4 + 1), "{counts:?}");
    let times = wire.since(from, 0x100);
    assert!((4..=5).contains(&times.len()), "{}", times.len());
    assert!(times.iter().all(|(at, time)| {
        let millis = u64::from(u32::from_le_bytes(time.data()[..4].try_into().unwrap()));
        time.data()[4..] == [0, 0] && at.as_micros().abs_diff(millis * 1_000) < 2_000
    }));
}
