//! Goal and controlword of each drive's power stage (CiA 402), and the drives that stay off.
//!
//! Drives are enabled only in `Boot`, but for one alone in a trial. A drive that leaves `Operation enabled` later stays off until a reset, so a
//! released emergency stop enables no drive. [`power_off`](crate::power_off) confirms that drives are off.

use crate::record::Mode;
use canopen::drive::{Controlword, Goal, PowerStage, State, Statusword};
use units::numbering::Joint;

/// Returns whether a drive with this statusword may apply torque; true for an invalid state.
pub(super) const fn may_apply_torque(statusword: Statusword) -> bool {
    match statusword.state() {
        Some(
            State::NotReadyToSwitchOn
            | State::SwitchOnDisabled
            | State::ReadyToSwitchOn
            | State::Fault,
        ) => false,
        Some(
            State::SwitchedOn
            | State::OperationEnabled
            | State::QuickStopActive
            | State::FaultReactionActive,
        )
        | None => true,
    }
}

/// Power stages of the six drives.
#[derive(Clone, Debug, Default)]
pub(super) struct PowerStages {
    stages: [PowerStage; 6],
    /// Set if the next fault while the drive is being enabled is reset.
    may_reset: [bool; 6],
    /// Drives that stay off while others may be on.
    kept_off: [bool; 6],
    /// Drives whose newest controlword disables voltage.
    must_be_off: [bool; 6],
    /// Drive that is enabled in another mode than `Boot`, all others being kept off.
    alone: Option<Joint>,
    /// Drive whose homing is started once it is enabled.
    homing: Option<Joint>,
}

impl PowerStages {
    /// Permits enabling of all drives, those kept off included, and one fault reset of each while it is being enabled.
    pub(super) fn allow_enabling(&mut self) {
        self.may_reset = [true; 6];
        self.kept_off = [false; 6];
        self.alone = None;
    }

    /// Lets this drive, which may have been kept off, be enabled alone; `None` for none.
    pub(super) const fn enable_alone(&mut self, joint: Option<Joint>) {
        self.alone = joint;
        if let Some(joint) = joint {
            *joint.entry_mut(&mut self.kept_off) = false;
        }
    }

    /// Keeps the drive of this joint off until [`allow_enabling`](Self::allow_enabling).
    pub(super) const fn keep_off(&mut self, joint: Joint) {
        *joint.entry_mut(&mut self.kept_off) = true;
    }

    /// Starts the homing of a drive that is enabled in homing mode, or ends it.
    pub(super) const fn set_homing(&mut self, joint: Option<Joint>) {
        self.homing = joint;
    }

    /// Returns the drives whose newest controlword disables voltage.
    pub(super) const fn must_be_off(&self) -> [bool; 6] {
        self.must_be_off
    }

    /// Returns the goal of a drive in `state`, with the node in `mode`.
    pub(super) fn goal(
        &self,
        joint: Joint,
        state: Option<State>,
        mode: Mode,
        drives_on: bool,
    ) -> Goal {
        let is_kept_off = *joint.entry(&self.kept_off);
        let may_be_enabled = mode == Mode::Boot || self.alone == Some(joint);
        let may_be_on = may_be_enabled || state == Some(State::OperationEnabled);
        if drives_on && may_be_on && !is_kept_off {
            Goal::OperationEnabled
        } else {
            Goal::VoltageDisabled
        }
    }

    /// Returns the controlword that brings a drive from `state` towards `goal`.
    pub(super) fn controlword(
        &mut self,
        joint: Joint,
        state: Option<State>,
        goal: Goal,
    ) -> Controlword {
        *joint.entry_mut(&mut self.must_be_off) = goal == Goal::VoltageDisabled;
        let stage = joint.entry_mut(&mut self.stages);
        let may_reset = joint.entry_mut(&mut self.may_reset);
        let is_enabling = goal == Goal::OperationEnabled;
        if state == Some(State::Fault) && is_enabling && std::mem::take(may_reset) {
            stage.reset_fault();
        }
        let word = stage.controlword(state, goal);
        let is_homed = self.homing == Some(joint) && state == Some(State::OperationEnabled);
        if is_homed && word == Controlword::ENABLE_OPERATION {
            Controlword::START_HOMING
        } else {
            word
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENABLED: Option<State> = Some(State::OperationEnabled);
    const FIRST: Joint = Joint::of::<1>();

    #[test]
    fn drives_are_enabled_only_in_boot() {
        let stages = PowerStages::default();
        for mode in Mode::ALL {
            for state in [None, Some(State::SwitchOnDisabled), Some(State::SwitchedOn)] {
                let is_enabled = stages.goal(FIRST, state, mode, true) == Goal::OperationEnabled;
                assert_eq!(is_enabled, mode == Mode::Boot, "{mode} {state:?}");
            }
            assert_eq!(stages.goal(FIRST, ENABLED, mode, true), Goal::OperationEnabled);
            assert_eq!(stages.goal(FIRST, ENABLED, mode, false), Goal::VoltageDisabled);
        }
    }

    #[test]
    fn first_fault_while_enabling_is_reset_and_the_second_is_not() {
        let mut stages = PowerStages::default();
        stages.allow_enabling();
        let mut word = |state| stages.controlword(FIRST, Some(state), Goal::OperationEnabled);
        assert_eq!(word(State::OperationEnabled), Controlword::ENABLE_OPERATION, "an old word");
        assert_eq!(word(State::Fault), Controlword::FAULT_RESET);
        assert_eq!(word(State::SwitchOnDisabled), Controlword::SHUTDOWN);
        assert_eq!([word(State::Fault), word(State::Fault)], [Controlword::DISABLE_VOLTAGE; 2]);
    }

    #[test]
    fn drive_kept_off_stays_off_alone_until_a_reset() {
        let mut stages = PowerStages::default();
        stages.keep_off(Joint::of::<3>());
        let goals = |stages: &PowerStages| {
            Joint::ALL.map(|joint| stages.goal(joint, ENABLED, Mode::ZeroTorque, true))
        };
        let (on, off) = (Goal::OperationEnabled, Goal::VoltageDisabled);
        assert_eq!(goals(&stages), [on, on, off, on, on, on]);
        stages.allow_enabling();
        assert_eq!(goals(&stages), [on; 6]);
    }
}
