//! Benchmark of the control loop on the in-memory bus: without a recorder, with a recorder, and with a recorder that hangs.
//!
//! `cargo bench --bench recorder` prints the median and the 99.9th percentile of each cycle time (promise 13 of
//! docs/safety.md). The three cases run alternately, so other load of the machine affects all of them equally.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "a benchmark prints, and cannot go on without what it needs"
)]

use std::path::Path;
use std::time::{Duration, Instant};

use bus::Tap;
use canopen::frame::Telegram;
use canopen::master::event::Event;
use config::Config;
use node::record::Record;
use run::rings::{EntryHandler, EntryProducer, rings};
use sim::scenario::Scenario;
use testbench::bench::Bench;

const SCENARIO: &str = include_str!("../config/scenarios/contact_10s.toml");
const TURNS: usize = 100;
const CYCLES: usize = 90;

/// Recorder that discards its data.
struct Drain;

impl EntryHandler for Drain {
    fn on_frame(&mut self, _: units::time::Instant, _: &Telegram) {}
    fn on_record(&mut self, _: &Record) {}
    fn on_event(&mut self, _: &Event) {}
}

fn main() {
    let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
    let mut spans: [Vec<Duration>; 3] = Default::default();
    for round in 0..10 {
        let (taken, mut taker, _) = rings();
        let (hanging, hung, _) = rings();
        let mut alone = booted(&config, ());
        let mut drained = booted(&config, taken);
        let mut stuck = booted(&config, hanging);
        for _ in 0..TURNS {
            measure(&mut alone, |_, _| {}, &mut spans[0]);
            measure(&mut drained, EntryProducer::push_record, &mut spans[1]);
            taker.take(usize::MAX, &mut Drain);
            measure(&mut stuck, EntryProducer::push_record, &mut spans[2]);
        }
        drop(hung);
        if round == 0 {
            spans.iter_mut().for_each(Vec::clear); // caches are warm
        }
    }
    for (name, spans) in ["no recorder", "recorder", "recorder that hangs"].iter().zip(&mut spans) {
        spans.sort();
        let at = |permille: usize| {
            spans.get(spans.len() * permille / 1_000).unwrap().as_secs_f64() * 1e6
        };
        println!(
            "{name:20} p50 {:6.2} µs, p99.9 {:6.2} µs ({} cycles)",
            at(500),
            at(999),
            spans.len()
        );
    }
}

fn booted<T: Tap>(config: &Config, tap: T) -> Bench<T> {
    let mut bench = Bench::new(config, Scenario::parse(SCENARIO).unwrap(), 1, tap);
    bench.bring_up().unwrap();
    bench
}

/// Measures cycles, with the recorder's work on each record.
fn measure<T: Tap>(
    bench: &mut Bench<T>,
    mut offer: impl FnMut(&mut T, &Record),
    spans: &mut Vec<Duration>,
) {
    for _ in 0..CYCLES {
        let begun = Instant::now();
        let record = bench.cycle();
        offer(bench.tap_mut(), &record);
        spans.push(begun.elapsed());
    }
}
