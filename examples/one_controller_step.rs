//! Runs one cycle of the paper's control law: joint positions and a measured wrench in, torques and a command out.
//!
//! `cargo run --release --example one_controller_step`
#![allow(clippy::print_stdout, reason = "an example prints")]

use std::error::Error;
use std::path::Path;

use nalgebra::Isometry3;

use config::Config;
use controller::switches::{CommandMode, Switches};
use controller::{Controller, Input};
use units::spatial::Wrench;

fn main() -> Result<(), Box<dyn Error>> {
    let config = Config::load(Path::new("config/kraft_like.toml"))?;
    let mut controller = Controller::new(&config.controller);

    // Joint positions in rad; a wrench of -5 N along x on the object; full gravity compensation.
    let q = [0.05, -0.8, 1.6, -0.7, 0.1, 0.2].into();
    let input = Input {
        counts: config.controller.calibration.counts(&q),
        f_s: Wrench::from_components([-5.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        x_b_m: Isometry3::identity(),
        switches: Switches { deadman: true, reference: false, reflection: false },
        mode: CommandMode::Rate,
        gravity_share: 1.0,
        reflection_share: 1.0,
        hold: false,
        held: None,
        restart: true,
    };
    let output = controller.step(&input);

    let grip = output.x_0_g.translation.vector;
    println!("grip in {{0}}, m:           {:.3?}", grip.as_slice());
    println!("torques of gravity, N·m: {:.3?}", output.ledger.gravity.as_slice());
    println!("torques in all, N·m:     {:.3?}", output.tau.as_slice());
    println!("targets of the drives:   {:?}", output.targets);
    Ok(())
}
