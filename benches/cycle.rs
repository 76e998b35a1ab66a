//! Benchmark of one `Controller::step` with all functions active: six joints, both energy layers, walls, soft stops,
//! ledger.
//!
//! `cargo bench --bench cycle` prints the median, the 99th percentile and the maximum; with `-- --steps N`
//! it runs N steps and prints nothing, for counting instructions (`scripts/bench.sh`).
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::disallowed_methods,
    reason = "a benchmark prints, and cannot go on without what it needs"
)]

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use nalgebra::SVector;

use config::Config;
use controller::switches::{CommandMode, Switches};
use controller::{Controller, Input};
use units::spatial::Wrench;

const TEXT: &str = include_str!("../config/kraft_like.toml");

/// Functions that the shipped configuration does not use.
const MORE: &str = "
[controller.walls]
at_m = [0.1, 0.1, 0.1]
at_rad = [0.8, 0.8, 0.8]
stiffness_n_per_m = [100.0, 100.0, 100.0]
stiffness_nm_per_rad = [1.0, 1.0, 1.0]
in_pose_mode = true

[controller.tank]
initial_j = 0.1
min_j = 0.0
low_j = 0.02
max_j = 0.5
refill_ns_per_m_per_j = 100.0

[controller.virtual_coupling]
stiffness_n_per_m = [400.0, 400.0, 400.0]
stiffness_nm_per_rad = [2.0, 2.0, 2.0]
damping_ns_per_m = [2.0, 2.0, 2.0]
damping_nms_per_rad = [0.01, 0.01, 0.01]

[remote]
";

fn main() {
    let steps = std::env::args().skip_while(|arg| arg != "--steps").nth(1);
    let steps: Option<usize> = steps.and_then(|steps| steps.parse().ok());
    let text = TEXT.replacen("[remote]\n", MORE, 1).replacen(
        "torque_rise_s",
        "velocity_filter_s = 0.005\ntorque_rise_s",
        1,
    );
    let config = Config::parse(Path::new("config/kraft_like.toml"), &text).unwrap();
    let inputs = inputs(&config);
    let mut controller = Controller::new(&config.controller);
    if let Some(steps) = steps {
        for step in 0..steps {
            black_box(controller.step(black_box(&inputs[step % inputs.len()])));
        }
        return;
    }

    let mut spans = Vec::with_capacity(500_000);
    for step in 0..spans.capacity() {
        let input = &inputs[step % inputs.len()];
        let begun = Instant::now();
        black_box(controller.step(black_box(input)));
        spans.push(begun.elapsed());
    }
    spans.sort();
    let at = |percent: usize| spans[spans.len() * percent / 100].as_secs_f64() * 1e6;
    println!(
        "Controller::step, everything on: p50 {:.2} µs, p99 {:.2} µs, max {:.1} µs ({} steps)",
        at(50),
        at(99),
        spans.last().unwrap().as_secs_f64() * 1e6,
        spans.len()
    );
}

/// Generates inputs of a hand in contact, alternately in rate mode and pose mode.
fn inputs(config: &Config) -> Vec<Input> {
    let start = SVector::from(config.joints.each_ref().map(|joint| joint.plant.start));
    (0..4_000_u32)
        .map(|cycle| {
            let t = f64::from(cycle) * 1e-3;
            let q = start.map(|q| q + 0.2 * (3.0 * t + q).sin());
            let pressed = cycle % 1_000 == 5;
            Input {
                counts: config.controller.calibration.counts(&q),
                f_s: Wrench::from_components([-8.0 * t.sin().abs(), 1.0, 0.5, 0.05, 0.1, 0.0]),
                x_b_m: config.remote.x_b_m,
                switches: Switches {
                    deadman: cycle > 1,
                    reference: pressed,
                    reflection: cycle == 3,
                },
                mode: if cycle < 2_000 { CommandMode::Rate } else { CommandMode::Pose },
                gravity_share: 1.0,
                reflection_share: 1.0,
                hold: false,
                held: None,
                restart: cycle == 0,
            }
        })
        .collect()
}
