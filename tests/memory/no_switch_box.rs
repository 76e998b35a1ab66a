//! A configuration without `[switches]`: it boots, proves and stops, and nothing can be armed.

use crate::common::prelude::*;
use config::NoSwitchBox;
use telemetry::losses::Losses;
use telemetry::status::Status;

const FILES: [&str; 2] = [KRAFT, JPL];

/// Returns a shipped configuration without its section `[switches]`.
fn without_switches(file: &str) -> Config {
    let text = fs::read_to_string(file).unwrap();
    let (before, after) = text.split_once("\n[switches]\n").unwrap();
    let (_, after) = after.split_once("\n[controller]\n").unwrap();
    parse(file, &format!("{before}\n[controller]\n{after}"))
}

fn bench(file: &str) -> (Bench<Wire>, Wire) {
    let wire = Wire::default();
    (Bench::new(&without_switches(file), scenario("free"), 1, wire.clone()), wire)
}

#[test]
fn network_without_switch_box_has_six_nodes() {
    for file in FILES {
        let (config, with) = (without_switches(file), config(file));
        assert_eq!((config.node_plans().len(), config.data_sheets().count()), (6, 6));
        assert!(config.node_plans().iter().all(|(_, plan)| plan.is_drive()));
        let load = |config: &Config| config.loads().iter().map(|load| load.percent()).sum::<f64>();
        assert!(load(&config) < load(&with), "no frame of a switch box is counted");
        assert_eq!(config.switch_box().err(), Some(NoSwitchBox));
    }
}

#[test]
fn drives_without_switch_box_are_proven_and_never_armed() {
    for file in FILES {
        let (mut bench, wire) = bench(file);
        bench.bring_up().unwrap();
        assert_eq!(bench.node().mode(), Mode::Ready);
        let proven = &bench.node().proof_test_report().drives;
        assert!(proven.len() == 6 && proven.iter().all(|drive| drive.rpdo.is_some()));
        let refused = bench.ask(Request::Arm).unwrap_err().to_string();
        assert!(refused.contains("nothing can be armed: there is no deadman"), "{refused}");
        assert!(refused.contains("add [switches]"), "{refused}");
        let record = bench.cycle();
        assert_eq!(Status::from_record(&record, 0, Losses::default()).switches_online, None);
        // The script of the operator arms and holds the deadman.
        for _ in 0..2_000 {
            let record = bench.cycle();
            assert_eq!((record.mode, record.cause, record.targets), (Mode::Ready, None, [0; 6]));
        }
        for box_cob_id in [0x190, 0x590, 0x610, 0x710] {
            assert_eq!(wire.since(Instant::ZERO, box_cob_id), [], "{box_cob_id:03X}h");
        }
        bench.shut_down().unwrap();
        bench.fall_silent_for(Duration::from_secs(1));
        let drives = bench.node().bus().stations().drives();
        assert!(drives.iter().all(|drive| drive.state() == State::SwitchOnDisabled));
    }
}

#[test]
fn silent_switch_box_is_another_refusal() {
    let config = config(FILES[0]);
    let mut bench = started(&config, scenario("free"), Wire::default());
    bench.world_mut().switches_mut().unwrap().unplug();
    bench.run(20);
    let refused = bench.ask(Request::Arm).unwrap_err().to_string();
    assert_eq!(refused, "no inputs from the switch box: check its power and cable");
    let record = bench.cycle();
    assert_eq!(Status::from_record(&record, 0, Losses::default()).switches_online, Some(false));
}
