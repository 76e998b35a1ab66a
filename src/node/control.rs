//! Controller, and the operator's command mode (rate or pose).

use crate::newest_remote_sample::NewestRemoteSample;
use crate::operator::OperatorMonitors;
use crate::permit::Permit;
use crate::record::{Mode, RefusedPress};
use config::Config;
use controller::adjustment::{AdjustmentError, AdjustmentState};
use controller::breakaway::Breakaway;
use controller::hold::HoldGoal;
use controller::hold::weight::TooHeavy;
use controller::switches::CommandMode;
use controller::{Controller, DriveTargets, Input, JointVector, Output};
use units::adjustment::Adjustment;
use units::drive::{Counts, PerMille};
use units::numbering::Joint;

/// Controller, its command mode, and the targets that it takes for held.
#[derive(Clone, Debug)]
pub(super) struct Control {
    controller: Controller,
    pub(super) command_mode: CommandMode,
    /// Targets that the drives hold since the last cycle.
    held: DriveTargets,
    has_goal: bool,
}

impl Control {
    /// Returns the controller and the command mode of the configuration.
    pub(super) fn new(config: &Config) -> Self {
        Self {
            controller: Controller::new(&config.controller),
            command_mode: config.command_mode,
            held: DriveTargets::Sent([PerMille(0); 6]),
            has_goal: false,
        }
    }

    /// Returns the input of a step: counts of the joints from their zeros, the commanded side, the operator's switches and the
    /// permit. `restart` after a gap.
    pub(super) fn input(
        &self,
        counts: [Counts; 6],
        newest: &NewestRemoteSample,
        operator: &OperatorMonitors,
        permit: &Permit,
        restart: bool,
    ) -> Input {
        Input {
            counts,
            f_s: newest.f_s(),
            x_b_m: newest.x_b_m(),
            switches: operator.switches(permit.engaged),
            mode: self.command_mode,
            gravity_share: permit.gravity_share,
            reflection_share: permit.reflection_share,
            hold: permit.hold,
            held: Some(self.held),
            restart,
        }
    }

    /// Keeps the targets that the drives hold from this cycle on.
    pub(super) const fn set_held(&mut self, held: DriveTargets) {
        self.held = held;
    }

    /// Sets the goal to which the hold moves the arm, or none.
    pub(super) fn set_hold(&mut self, goal: Option<HoldGoal>) {
        self.has_goal = goal.is_some();
        self.controller.set_hold(goal);
    }

    /// Checks that the actuators can carry the arm on the way from `from` to `to`, in rad or m.
    ///
    /// # Errors
    /// Returns the actuator with the greatest load beyond its capacity.
    pub(super) fn check_way(&self, from: &JointVector, to: &JointVector) -> Result<(), TooHeavy> {
        self.controller.check_way(from, to)
    }

    /// Returns the breakaway of a joint as described, with the arm at `q`, in rad or m.
    pub(super) fn breakaway(&self, joint: Joint, q: &JointVector) -> Breakaway {
        self.controller.breakaway(joint, q)
    }

    /// Takes a change of scales, locks or alignment.
    ///
    /// # Errors
    /// When the change is out of bounds, or not possible now.
    pub(super) fn adjust(&mut self, adjustment: Adjustment) -> Result<(), AdjustmentError> {
        self.controller.adjust(adjustment)
    }

    /// Takes the press of a button. Presses alternate between a scale and 1, or between a lock and its release.
    ///
    /// # Errors
    /// When the change is not possible now.
    pub(super) fn press(&mut self, button: Adjustment) -> Result<(), RefusedPress> {
        let AdjustmentState { scale, locked, .. } = self.controller.adjusted();
        let adjustment = match button {
            Adjustment::Scale(quantity, factor) => {
                let is_set = scale.factor(quantity).to_bits() == factor.to_bits();
                Adjustment::Scale(quantity, if is_set { 1.0 } else { factor })
            }
            Adjustment::Lock(axis, _) => Adjustment::Lock(axis, !axis.entry(&locked)),
            Adjustment::Align => Adjustment::Align,
        };
        self.adjust(adjustment).map_err(|refused| RefusedPress { adjustment, refused })
    }

    /// Computes one step. A hold ends with its mode; its damping stays in the stop that carries the arm.
    pub(super) fn step(&mut self, mode: Mode, input: &Input) -> Output {
        if self.has_goal && mode != Mode::Measuring {
            self.set_hold(None);
        }
        if !matches!(mode, Mode::Measuring | Mode::ReflectionOff) {
            self.controller.let_go();
        }
        self.controller.step(input)
    }
}
