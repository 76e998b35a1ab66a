//! Controlwords (6040h) and target torques (6071h) of the six drives, in the RPDOs of the layout.

use crate::power::PowerStages;
use crate::record::Mode;
use crate::target_limiter::TargetLimiter;
use canopen::drive::Goal;
use canopen::exchange::RpdoImage;
use canopen::pdo::DriveSample;
use config::Config;
use units::drive::PerMille;
use units::numbering::Joint;

/// Controlwords and target torques of the drives.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    /// Next content of the drives' RPDOs.
    pub(super) rpdos: RpdoImage,
    pub(super) power: PowerStages,
    /// Limits of the targets and of their rise.
    pub(super) limiter: TargetLimiter,
}

impl Drives {
    /// Returns the drives at zero torque, not enabled.
    pub(super) fn new(config: &Config, rpdos: RpdoImage) -> Self {
        let max_targets = config.joints.each_ref().map(|joint| joint.calibration.max_target());
        Self { rpdos, power: PowerStages::default(), limiter: TargetLimiter::new(max_targets) }
    }

    /// Sets the targets, and the controlwords for the drives' states, in the RPDOs.
    pub(super) fn set(
        &mut self,
        latest: &[DriveSample; 6],
        targets: &[PerMille; 6],
        mode: Mode,
        drives_on: bool,
    ) {
        for (joint, (sample, target)) in Joint::each(latest.iter().zip(targets)) {
            let node = joint.into();
            self.rpdos.set_target_torque(node, *target);
            let state = sample.statusword.state();
            let goal = self.power.goal(joint, state, mode, drives_on);
            // A fault reset is an edge: a waiting controlword is replaced only by disable voltage.
            if goal == Goal::VoltageDisabled || !self.rpdos.is_waiting(node) {
                let word = self.power.controlword(joint, state, goal);
                self.rpdos.set_controlword(node, word, goal.is_reached(state));
            }
        }
    }
}
