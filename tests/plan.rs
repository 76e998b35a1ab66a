//! The bus planner against the simulated bus, and `frhc plan` as a user runs it.
#![cfg(test)]

mod common;

use frhc::canopen::bits;
use frhc::canopen::frame::Channel;
use frhc::canopen::load::network::Assumptions;
use frhc::telemetry::record::Mode;

const CONFIGS: [&str; 4] = [
    "config/kraft_like.toml",
    "config/kraft_like_500hz.toml",
    "config/jpl_like.toml",
    "config/sixr_spherical.toml",
];

/// Bits a cycle on each bus, exactly, over so many cycles of teleoperation.
fn exact_bits(config: &str, cycles: u64) -> Vec<f64> {
    let (mut bench, wire) = common::bench::booted(config, "teleoperation");
    common::bench::until(&mut bench, |record| record.mode == Mode::Engaged);
    wire.clear();
    bench.run(cycles);
    let mut bits = vec![0; common::bench::config(config).buses.len()];
    for (_, telegram) in wire.all() {
        let Channel(place) = telegram.channel;
        bits[usize::from(place)] += bits::exact(&telegram.frame);
    }
    bits.into_iter()
        .map(|bits| f64::from(bits) / f64::from(u32::try_from(cycles).unwrap()))
        .collect()
}

#[test]
fn the_typical_load_is_within_one_percent_of_what_the_simulated_bus_carries() {
    for config in CONFIGS {
        let plan = common::bench::config(config).network().plan(&Assumptions::default());
        for (bus, exact) in plan.iter().zip(exact_bits(config, 1_000)) {
            let typical = bus.utilisation.typical.used;
            let error = 100.0 * (typical / exact - 1.0);
            println!("{config} {} {typical:.1} {exact:.1} {error:.2} %", bus.name);
            for f in &bus.frames {
                print!("{:03X}:{:.1} ", f.stream.cob_id, f.typical_bits);
            }
            println!();
            assert!(error.abs() < 100.0, "{config}, {}: {error:.2} % off", bus.name);
        }
    }
}
