//! What our master makes of drives at their worst: a table, as a data sheet would have it. Each
//! personality is that of the elbow's drive, once with the targets of three drives in one frame at 1 kHz,
//! once with a frame for each drive at 500 Hz.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;

use common::bench::Wire;
use common::bench::config;
use common::bench::scenario;
use common::bench::until;
use frhc::bus::Bus;
use frhc::lab::bench::Bench;
use frhc::sim::personality::Quirk;
use frhc::telemetry::record::Mode;

const ELBOW: usize = 3;
const GROUPED: &str = "config/kraft_like.toml";
const PER_DRIVE: &str = "config/kraft_like_500hz.toml";

fn bench(config_name: &str, quirks: &[&str]) -> (Bench<Wire>, Wire) {
    let mut scenario = scenario("contact_10s");
    let quirks = quirks.iter().map(|quirk| quirk.parse::<Quirk>().unwrap());
    scenario.cast_mut().add(ELBOW, quirks).unwrap();
    let wire = Wire::default();
    (Bench::new(&config(config_name), scenario, 1, false, wire.clone()), wire)
}

#[test]
fn explore() {
    for config_name in [GROUPED, PER_DRIVE] {
        for name in Quirk::NAMES {
            let (mut bench, _) = bench(config_name, &[name]);
            let result = bench.bring_up();
            let at = bench.node().bus().now();
            print!("{config_name} {name}: {:?} at {at:?} ", result.map_err(|e| e.to_string()));
            if bench.node().mode() == Mode::Ready {
                let record = until(&mut bench, |record| {
                    record.mode == Mode::Stopped
                        || record.mode == Mode::Engaged && record.f_s.force.norm() > 3.0
                });
                print!("{:?} {:?}", record.mode, record.cause);
                print!(" stop {:?}", bench.stop());
            }
            let drives = bench.world_mut().drives();
            println!(" {}", drives[2].state());
        }
    }
}
