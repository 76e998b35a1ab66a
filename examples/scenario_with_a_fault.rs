//! Unplugs a drive while an operator holds the grip, and prints the changes of the node's mode.
//!
//! `cargo run --release --example scenario_with_a_fault`
#![allow(clippy::print_stdout, reason = "an example prints")]

use std::error::Error;
use std::path::Path;

use config::Config;
use sim::scenario::Scenario;
use testbench::bench::Bench;
use units::time::Instant;

const SCENARIO: &str = r#"
    seconds = 3.0

    [[console]]
    at_s = 0.1
    request = "arm"

    [[switch]]
    at_s = 0.3
    deadman = true

    [[fault]]
    at_s = 1.0
    kind = "unplug"
    joint = 3
"#;

fn main() -> Result<(), Box<dyn Error>> {
    let config = Config::load(Path::new("config/kraft_like.toml"))?;
    let mut bench = Bench::new(&config, Scenario::parse(SCENARIO)?, 1, ());
    bench.bring_up()?;
    let mut mode = None;
    for _ in 0..3_000 {
        let record = bench.cycle();
        if mode != Some(record.mode) {
            let cause = record.cause.map_or(String::new(), |cause| format!(": {cause}"));
            println!(
                "{:.3} s  {}{cause}",
                record.at.since(Instant::ZERO).as_secs_f64(),
                record.mode
            );
            mode = Some(record.mode);
        }
    }
    Ok(())
}
