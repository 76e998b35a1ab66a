//! What the six drives are commanded: controlwords and target torques, in the RPDOs of the layout.

use crate::gate::Gate;
use crate::power::PowerStages;
use crate::record::Mode;
use canopen::drive::Goal;
use canopen::exchange::Outbox;
use canopen::pdo::DriveSample;
use config::Config;
use units::drive::PerMille;
use units::numbering::Joint;

/// Controlwords and targets of the drives.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    /// RPDOs of the drives, as they are sent next.
    pub(super) rpdos: Outbox,
    pub(super) power: PowerStages,
    /// Limits of targets and of their growth.
    pub(super) gate: Gate,
}

impl Drives {
    /// Drives at zero torque, none of them enabled.
    pub(super) fn new(config: &Config, rpdos: Outbox) -> Self {
        let max_targets = config.joints.each_ref().map(|joint| joint.calibration.max_target());
        Self {
            rpdos,
            power: PowerStages::new(config.safety.missing_samples),
            gate: Gate::new(max_targets),
        }
    }

    /// Puts targets and the controlwords that follow from the drives' states into the RPDOs.
    pub(super) fn set(
        &mut self,
        latest: &[DriveSample; 6],
        targets: &[PerMille; 6],
        mode: Mode,
        drives_on: bool,
    ) {
        for (joint, (sample, target)) in Joint::each(latest.iter().zip(targets)) {
            let node = joint.into();
            self.rpdos.exert(node, *target);
            let state = sample.statusword.state();
            let goal = self.power.goal(joint, state, mode, drives_on);
            // A fault is reset by an edge, so no word is replaced before it is sent, unless by "off".
            if goal == Goal::VoltageDisabled || !self.rpdos.is_waiting(node) {
                let word = self.power.controlword(joint, state, goal);
                self.rpdos.lead(node, word, goal.is_reached(state));
            }
        }
    }
}
