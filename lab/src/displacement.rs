//! Motion of the hand that makes a wanted translation of ΔX, from the start of the simulated arm.

use nalgebra::Vector3;

use config::Config;
use controller::interpretation::DisplacementFrame;
use testbench::world;

/// Returns the hand's motion in {0}, in m, for a translation `dx` in m as the law writes it.
pub(crate) fn in_base(config: &Config, dx: &Vector3<f64>) -> Vector3<f64> {
    let plant = config.plant();
    let arm = world::arm(&plant);
    let r_0_g = arm.pose(&arm.posture(&world::start(&plant))).rotation;
    match config.controller.interpretation.displacement {
        DisplacementFrame::Base => *dx,
        DisplacementFrame::Reference => r_0_g * dx,
    }
}
