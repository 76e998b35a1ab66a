//! Implausible samples in the complete control loop on the in-memory bus: their effect, and no stop without a cause.
//! `tests/memory/scenarios.rs` tests the reaction to each fault scenario.

use crate::common::prelude::*;
use node::cause::CauseKind;

/// Engaged after 0.3 s, and a hand that moves with 60 mm/s from 0.4 s on.
const MOVING: &str = "seconds = 2\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.3\ndeadman = true\n\
    [[switch]]\nat_s = 0.35\nreference = true\n[[switch]]\nat_s = 0.4\nreference = false\n\
    [[move]]\nat_s = 0.4\nduration_s = 1.0\nto_m = [0.06, 0.03, 0.0]\n";

/// Returns the records of the first `seconds`.
fn run(config: &Config, text: &str, seconds: f64) -> Vec<Record> {
    let mut bench = started(config, script(text), ());
    let mut records = Vec::new();
    while bench.elapsed().as_secs_f64() < seconds {
        records.push(bench.cycle());
    }
    records
}

/// Returns the largest difference between targets of two runs, in ‰ of rated torque.
fn apart(one: &[Record], other: &[Record]) -> u16 {
    let targets = one.iter().zip(other).map(|(one, other)| (one.targets, other.targets));
    let apart = targets.flat_map(|(one, other)| {
        std::array::from_fn::<_, 6, _>(|joint| one[joint].abs_diff(other[joint]))
    });
    apart.max().unwrap()
}

fn with_fault(fault: &str) -> String {
    format!("{MOVING}[[fault]]\nat_s = 0.6\n{fault}")
}

/// Returns a configuration whose elbow range ends 2° from its start at 95°.
fn with_narrow_elbow() -> Config {
    let narrow = [("limit_deg = [0.0, 140.0]", "limit_deg = [93.0, 140.0]")];
    parse(KRAFT, &changed(KRAFT_TEXT, &narrow))
}

#[test]
fn hazard_04_delay_below_three_cycles_hardly_changes_torque() {
    let config = config(KRAFT);
    let in_time = run(&config, MOVING, 1.1);
    for (delay, most) in [("1.2", 5), ("2.2", 8), ("1.7\nreorder = true\nshare = 0.05", 8)] {
        let fault = format!(
            "kind = \"delay\"\njoint = 3\nframe = \"tpdo1\"\ndelay_ms = {delay}\nfor_s = 0.3\n"
        );
        let late = run(&config, &with_fault(&fault), 1.1);
        assert_eq!(late.last().unwrap().cause, None, "{delay} ms");
        let apart = apart(&in_time, &late);
        assert!((1..=most).contains(&apart), "{delay} ms: {apart} ‰");
    }
}

/// Scenario faults: the elbow's samples are delayed by one more cycle every 50 ms, up to `max_cycles`, then not at all.
fn growing_delay(config: &Config, max_cycles: u32) -> String {
    let period_ms = config.period.as_secs_f64() * 1e3;
    let step = |age: u32| {
        let (at_s, delay_ms) = (0.6 + 0.05 * f64::from(age - 1), period_ms * f64::from(age));
        let keys = "kind = \"delay\"\njoint = 3\nframe = \"tpdo1\"";
        format!("[[fault]]\nat_s = {at_s}\n{keys}\ndelay_ms = {delay_ms}\nfor_s = 0.05\n")
    };
    (1..=max_cycles).map(step).collect()
}

#[test]
fn hazard_04_growing_delay_stops_the_node_at_14_cycles() {
    for name in [KRAFT, KRAFT_500HZ, JPL] {
        let config = config(name);
        let records = run(&config, &format!("{MOVING}{}", growing_delay(&config, 26)), 1.6);
        let begun = records[0].at;
        let stopped = records.iter().find(|record| record.mode.is_stopped()).unwrap();
        let is_it =
            matches!(stopped.cause, Some(Cause::SamplesOverdue { joint: ELBOW, cycles: 11 }));
        assert!(is_it, "{name}: {:?}", stopped.cause);
        let age = (stopped.at.since(begun).as_secs_f64() - 0.6) / 0.05;
        assert!(age <= 14.0, "{name}: {age} cycles old");
    }
}

#[test]
fn hazard_04_end_of_a_delay_is_not_a_duplicate_node() {
    for most in [3, 6, 9] {
        let config = config(KRAFT);
        let records = run(&config, &format!("{MOVING}{}", growing_delay(&config, most)), 1.6);
        let cause = records.last().unwrap().cause;
        let fits = matches!(cause, None | Some(Cause::SamplesOverdue { joint: ELBOW, .. }));
        assert!(fits, "{most} cycles: {cause:?}");
    }
}

#[test]
fn hazard_03_frequently_late_samples_end_reflection() {
    // One sample in ten is late by more than a cycle and replaced in the next, so at most two are overdue.
    let fault = "kind = \"delay\"\njoint = 3\nframe = \"tpdo1\"\ndelay_ms = 1.2\nshare = 0.1\n";
    let records = run(&config(KRAFT), &with_fault(fault), 1.6);
    let stopped = records.iter().find(|record| record.cause.is_some()).unwrap();
    let is_it = matches!(stopped.cause, Some(Cause::SamplesRare { joint: ELBOW, percent: 5 }));
    assert!(is_it && stopped.mode == Mode::ReflectionOff, "{:?}, {}", stopped.cause, stopped.mode);
    let last = records.last().unwrap();
    assert!(
        last.mode == Mode::ReflectionOff && last.targets != [0; 6],
        "gravity compensation goes on"
    );
}

/// Returns the targets of a joint in each engaged cycle, in ‰ of rated torque.
fn targets_of(records: &[Record], joint: usize) -> Vec<f64> {
    let engaged = records.iter().filter(|record| record.mode == Mode::Engaged);
    engaged.map(|record| f64::from(record.targets[joint])).collect()
}

/// Returns the RMS difference between torque readings and the targets `age` cycles before.
fn misfit(readings: &[f64], targets: &[f64], age: usize) -> f64 {
    let differences = readings[50..].iter().zip(&targets[50 - age..]);
    let squares: Vec<f64> =
        differences.map(|(read, target)| (read.round() - target).powi(2)).collect();
    (squares.iter().sum::<f64>() / f64::from(u32::try_from(squares.len()).unwrap())).sqrt()
}

#[test]
fn hazard_04_ten_cycle_delay_of_6077h_resembles_a_10_ms_filter() {
    let records = run(&config(KRAFT), MOVING, 1.6);
    // The joints that gravity loads.
    for joint in 1..4 {
        let targets = targets_of(&records, joint);
        let older = misfit(&targets, &targets, 11);
        assert!(older < 6.0, "joint {}: {older} ‰ in 11 cycles", joint + 1);
        let filter = |sum: &mut f64, target: &f64| {
            *sum += (target - *sum) / 10.0;
            Some(*sum)
        };
        let filtered: Vec<f64> = targets.iter().scan(targets[0], filter).collect();
        let best = (0..50).min_by(|one, other| {
            misfit(&filtered, &targets, *one).total_cmp(&misfit(&filtered, &targets, *other))
        });
        assert!((8..=12).contains(&best.unwrap()), "joint {}: {best:?}", joint + 1);
    }
}

#[test]
fn hazard_12_single_bit_error_in_one_sample_is_tolerated() {
    for (name, before) in [(KRAFT, ""), (KRAFT_500HZ, "0000")] {
        let config = config(name);
        for bit in [6, 8, 9, 10, 11, 16, 30] {
            let mask: String =
                (1_u32 << bit).to_le_bytes().iter().map(|byte| format!("{byte:02X}")).collect();
            for joint in [1, 3, 6] {
                let keys = format!("kind = \"corrupt\"\njoint = {joint}\nframe = \"tpdo1\"");
                let fault = format!("{keys}\nxor = \"{before}{mask}\"\ncount = 1\n");
                let records = run(&config, &with_fault(&fault), 0.7);
                assert_eq!(records.last().unwrap().cause, None, "{name}: joint {joint}, bit {bit}");
            }
        }
    }
}

#[test]
fn hazard_12_implausible_sample_is_discarded() {
    let config = config(KRAFT);
    let fault = "kind = \"corrupt\"\njoint = 3\nframe = \"tpdo1\"\nxor = \"00001000\"\ncount = 1\n";
    let (good, corrupted) = (run(&config, MOVING, 0.8), run(&config, &with_fault(fault), 0.8));
    assert_eq!(corrupted.last().unwrap().cause, None);
    let missed: Vec<_> = corrupted.iter().filter(|record| !record.sampled[2]).collect();
    assert_eq!(missed.len(), 1);
    assert!(apart(&good, &corrupted) <= 5);
}

#[test]
fn hazard_11_grip_above_1_m_per_s_stops_within_three_cycles() {
    let script = MOVING.replace(
        "duration_s = 1.0\nto_m = [0.06, 0.03, 0.0]",
        "duration_s = 0.12\nto_m = [0.0, 0.1, 0.0]",
    );
    let records = run(&config(KRAFT), &script, 0.6);
    let too_fast = |records: &[Record]| {
        let [before, now] = [0, 1].map(|n| records[n].output.x_0_g.translation.vector);
        (now - before).norm() > 1.0e-3
    };
    let first = records.windows(2).position(too_fast).unwrap() + 1;
    let stopped = records.iter().position(|record| record.mode.is_stopped()).unwrap();
    assert_eq!(records[stopped].cause, Some(Cause::GripOverspeed));
    assert!(stopped - first <= 2, "too fast in cycle {first}, stopped in {stopped}");
    assert!(records[stopped..].iter().all(|record| record.targets == [0; 6]));
}

#[test]
fn hazard_43_joint_beyond_its_limit_ends_reflection_at_once() {
    let narrow = with_narrow_elbow();
    let script = script(MOVING);
    let mut bench = Bench::in_world_of(&config(KRAFT), &narrow, script, 1, ());
    bench.bring_up().unwrap();
    let records: Vec<_> = (0..1_600).map(|_| bench.cycle()).collect();
    let beyond = records.iter().position(|record| record.output.q[2] < 93_f64.to_radians() - 0.02);
    let beyond = beyond.unwrap();
    assert_eq!(records[beyond - 1].mode, Mode::Engaged);
    assert_eq!(records[beyond].mode, Mode::ReflectionOff);
    let cause = records[beyond].cause.unwrap();
    assert_eq!((cause.kind(), cause.joint()), (CauseKind::BeyondLimit, Some(ELBOW)));
    assert!(
        cause.to_string().contains("°, beyond its limit of 91.9°: check zero_counts"),
        "{cause}"
    );
    assert_ne!(records.last().unwrap().targets, [0; 6]);
}

#[test]
fn hazard_43_arm_at_its_soft_stops_does_not_trip() {
    let records = run(&with_narrow_elbow(), MOVING, 1.6);
    let last = records.last().unwrap();
    assert_eq!(last.cause, None);
    assert!(last.output.joint_out_of_range.is_some(), "{}", last.output.q);
}

#[test]
fn promise_14_single_losses_of_one_per_mille_never_stop() {
    for name in ["kraft_like", "kraft_like_500hz", "jpl_like"] {
        let text = fs::read_to_string("config/scenarios/contact_10s.toml").unwrap();
        let lost = "[[fault]]\nat_s = 0.0\nkind = \"drop\"\njoint = \"all\"\nframe = \"tpdo1\"\nshare = 0.001\n";
        let records = run(&config(&format!("config/{name}.toml")), &format!("{text}{lost}"), 5.0);
        assert_eq!(records.last().unwrap().cause, None, "{name}");
        let lost = records.iter().filter(|record| record.sampled != [true; 6]).count();
        assert!((5..60).contains(&lost), "{name}: {lost}");
    }
}

/// Returns every shipped configuration of an arm.
fn shipped() -> Vec<String> {
    let files = |folder: &str| {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let files = entries.filter(|path| path.extension().is_some_and(|it| it == "toml"));
        files.map(|path| path.to_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let mut shipped = [files("config"), files("config/drives")].concat();
    shipped.sort();
    assert!(shipped.len() >= 10, "{shipped:?}");
    shipped
}

#[test]
fn promise_14_filtered_6077h_of_any_drive_never_stops() {
    for name in shipped() {
        for quirk in ["filtered-torque:5", "filtered-torque:-5"] {
            let text = fs::read_to_string("config/scenarios/contact_10s.toml").unwrap();
            let mut script = script(&text);
            for joint in Joint::ALL {
                script.quirks_mut().add(joint, [quirk.parse::<Quirk>().unwrap()]);
            }
            let mut bench = started(&config(&name), script, ());
            while bench.elapsed().as_secs_f64() < 4.0 {
                let record = bench.cycle();
                assert_eq!(record.cause, None, "{name}, {quirk}: {:?}", bench.elapsed());
            }
        }
    }
}

#[test]
fn hazard_10_torque_30_percent_too_low_is_seen() {
    // The elbow holds some 250 ‰, and reports 175 ‰.
    let fault = "kind = \"torque_actual_scale\"\njoint = 3\nscale = 0.7\n";
    let records = run(&config(KRAFT_500HZ), &with_fault(fault), 1.0);
    let cause = records.iter().find_map(|record| record.cause);
    assert_eq!(cause, Some(Cause::TorqueDiffers { joint: ELBOW }));
}

#[test]
fn promise_14_shipped_scenarios_never_stop_the_node() {
    for (config_name, script, seconds) in [
        ("jpl_like", "stiff-wall", 7.0),
        ("kraft_like_500hz", "stiff-wall", 7.0),
        ("jpl_like", "relaxed_10s", 5.0),
        ("jpl_like_1538hz", "contact_10s", 5.0),
        ("sixr_spherical", "free", 6.0),
    ] {
        let config = config(&format!("config/{config_name}.toml"));
        let mut bench = started(&config, scenario(script), ());
        while bench.elapsed().as_secs_f64() < seconds {
            let record = bench.cycle();
            assert_eq!(record.cause, None, "{config_name}, {script}");
        }
    }
}
