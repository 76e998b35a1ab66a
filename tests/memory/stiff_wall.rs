//! The scenario `stiff-wall`: every shipped arm meets its wall, and the verdict is that of the contact.

use crate::common::prelude::*;
use remote::site::Virtual;
use telemetry::fidelity::{Fidelity, WrenchSource};
use telemetry::summary::Summary;
use testbench::comparison::{self, Comparison, Verdict};
use testbench::truth::Truth;

/// Plays the scenario to the end.
fn played(config: &Config) -> Summary {
    let mut bench = started(config, scenario("stiff-wall"), ());
    let mut summary = Summary::default();
    let (mut truth, mut at_hand) = (Truth::new(config), Fidelity::new(WrenchSource::Hand));
    while bench.elapsed().as_secs_f64() < 16.0 {
        let record = bench.cycle();
        summary.add(&record);
        at_hand.add(truth.sample(&bench, &record).as_ref());
    }
    summary.fidelity = at_hand.report();
    summary
}

/// Compares both runs at a wall of `stiffness` N/m.
fn compared(name: &str, stiffness: f64) -> Comparison {
    let config = config(&format!("config/{name}.toml"));
    let mut wall = config.remote.wall.unwrap();
    wall.2.stiffness = stiffness;
    let config = config.clone().with_remote(Virtual { wall: Some(wall), ..config.remote.clone() });
    let without = played(&comparison::without_passivity(&config));
    Comparison::new(stiffness, without, played(&config))
}

#[test]
fn every_shipped_arm_meets_its_wall() {
    let arms = ["kraft_like", "kraft_like_500hz", "jpl_like", "jpl_like_1538hz", "sixr_spherical"];
    for name in arms {
        let config = config(&format!("config/{name}.toml"));
        let config = comparison::surrounded(&config, &scenario("stiff-wall"));
        let summary = played(&config);
        assert!(summary.contact_seconds > 1.0, "{name}: {summary}");
        assert_eq!(summary.stopped_by, None, "{name}");
        // Without the layer a wall that gives the hand joules ends reflection, and no other does.
        let without = played(&comparison::without_passivity(&config));
        assert!(without.contact_seconds > 0.5, "{name}: {without}");
        let is_driven = without.contact.lowest_energy_j < -1.5;
        assert!(without.stopped_by.is_none() || is_driven, "{name}: {without}");
    }
}

#[test]
fn passivity_layer_bounds_a_wall_too_stiff_for_the_loop() {
    let comparison = compared("kraft_like", 30_000.0);
    let (without, with) = (&comparison.without.contact, &comparison.with.contact);
    assert!(without.reversals > 10 && without.lowest_energy_j < -0.5, "{comparison}");
    assert!(with.reversals < without.reversals / 2, "{comparison}");
    assert_eq!(comparison.verdict, Verdict::Bounded, "{comparison}");
}

#[test]
fn layer_of_the_fast_cycle_bounds_a_wall_of_50_kn_per_m() {
    for (name, expected) in
        [("jpl_like", Verdict::NotBounded), ("jpl_like_1538hz", Verdict::Bounded)]
    {
        let comparison = compared(name, 50_000.0);
        assert_eq!(comparison.verdict, expected, "{name}: {comparison}");
    }
}

#[test]
fn verdict_on_soft_and_on_too_stiff_walls() {
    for (stiffness, expected) in [(2e3, Verdict::NothingToBound), (80e3, Verdict::NotBounded)] {
        let comparison = compared("kraft_like", stiffness);
        assert_eq!(comparison.verdict, expected, "{comparison}");
    }
}

#[test]
fn wall_out_of_reach_is_not_met() {
    let config = config(KRAFT);
    let mut wall = config.remote.wall.unwrap();
    wall.0.x = 0.7;
    let config = config.clone().with_remote(Virtual { wall: Some(wall), ..config.remote.clone() });
    let comparison = Comparison::new(2e3, played(&config), played(&config));
    assert_eq!(comparison.verdict, Verdict::WallNotMet, "{comparison}");
}
