//! Where each drive's power stage is led, and which drives are led nowhere any more.
//!
//! Only while the network comes up is a drive led to `Operation enabled`. Later one that has left it, for
//! whatever reason, stays off until a reset: a released emergency stop enables nothing. A drive that has
//! fallen silent may still hold a torque, as a synchronous RPDO waits for a SYNC it may not hear: it is
//! told by SDO, which acts at once, to take its power off.

use crate::record::Mode;
use canopen::drive::Controlword;
use canopen::drive::Goal;
use canopen::drive::PowerStage;
use canopen::drive::State;
use canopen::drive::Statusword;
use units::numbering::Joint;

/// Whether the power stage may still push. A state that is none counts as one that may.
pub(super) const fn may_push(statusword: Statusword) -> bool {
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

/// The power stages of the six drives.
#[derive(Clone, Debug)]
pub(super) struct PowerStages {
    stages: [PowerStage; 6],
    /// The next fault on the way up is reset.
    may_reset: [bool; 6],
    /// Off for itself, whatever the others do.
    dropped: [bool; 6],
    /// Told so by SDO.
    told: [bool; 6],
    /// Cycles without a sample.
    silent: [u32; 6],
    /// So many of them are too many.
    patience: u32,
}

impl PowerStages {
    /// None is led anywhere yet. A drive without a sample for `patience` cycles is silent.
    pub(super) fn new(patience: u32) -> Self {
        Self {
            stages: Default::default(),
            may_reset: [false; 6],
            dropped: [false; 6],
            told: [false; 6],
            silent: [0; 6],
            patience,
        }
    }

    /// One fault of each drive is reset, now or when it is heard of on the way up; dropped drives may be
    /// led again.
    pub(super) fn reset_faults(&mut self) {
        self.may_reset = [true; 6];
        self.dropped = [false; 6];
        self.told = [false; 6];
    }

    /// The drive of this joint is off for itself from now on.
    pub(super) const fn drop_drive(&mut self, joint: Joint) {
        *joint.entry_mut(&mut self.dropped) = true;
    }

    /// Takes which drives have answered this SYNC. The next one that is silent and was not told to take
    /// its power off, if the node `is_stopped`: once each.
    pub(super) fn next_silent(&mut self, fresh: [bool; 6], is_stopped: bool) -> Option<Joint> {
        let patience = self.patience;
        for (silent, is_fresh) in self.silent.iter_mut().zip(fresh) {
            *silent = if is_fresh { 0 } else { silent.saturating_add(1) };
        }
        let mut joints = Joint::each(self.silent.iter().zip(&mut self.told));
        let (joint, (_, told)) =
            joints.find(|(_, (silent, told))| is_stopped && **silent >= patience && !**told)?;
        *told = true;
        self.drop_drive(joint);
        Some(joint)
    }

    /// Where a drive in `state` is led in `mode`, if `drives_on`.
    pub(super) fn goal(
        &self,
        joint: Joint,
        state: Option<State>,
        mode: Mode,
        drives_on: bool,
    ) -> Goal {
        let is_dropped = *joint.entry(&self.dropped);
        let may_be_on = mode == Mode::Boot || state == Some(State::OperationEnabled);
        if drives_on && may_be_on && !is_dropped {
            Goal::OperationEnabled
        } else {
            Goal::VoltageDisabled
        }
    }

    /// The controlword for a drive in `state` on its way to `goal`.
    pub(super) fn controlword(
        &mut self,
        joint: Joint,
        state: Option<State>,
        goal: Goal,
    ) -> Controlword {
        let stage = joint.entry_mut(&mut self.stages);
        let may_reset = joint.entry_mut(&mut self.may_reset);
        let is_on_its_way = goal == Goal::OperationEnabled;
        if state == Some(State::Fault) && is_on_its_way && std::mem::take(may_reset) {
            stage.reset_fault();
        }
        stage.controlword(state, goal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENABLED: Option<State> = Some(State::OperationEnabled);
    const FIRST: Joint = Joint::of::<1>();

    #[test]
    fn only_a_boot_leads_a_drive_up_and_what_has_left_stays_off() {
        let stages = PowerStages::new(3);
        for mode in Mode::ALL {
            for state in [None, Some(State::SwitchOnDisabled), Some(State::SwitchedOn)] {
                let is_led = stages.goal(FIRST, state, mode, true) == Goal::OperationEnabled;
                assert_eq!(is_led, mode == Mode::Boot, "{mode} {state:?}");
            }
            assert_eq!(stages.goal(FIRST, ENABLED, mode, true), Goal::OperationEnabled);
            assert_eq!(stages.goal(FIRST, ENABLED, mode, false), Goal::VoltageDisabled);
        }
    }

    #[test]
    fn a_fault_that_is_heard_of_late_is_reset_and_the_one_after_it_is_not() {
        let mut stages = PowerStages::new(3);
        stages.reset_faults();
        let mut word = |state| stages.controlword(FIRST, Some(state), Goal::OperationEnabled);
        assert_eq!(word(State::OperationEnabled), Controlword::ENABLE_OPERATION, "an old word");
        assert_eq!(word(State::Fault), Controlword::FAULT_RESET);
        assert_eq!(word(State::SwitchOnDisabled), Controlword::SHUTDOWN);
        assert_eq!([word(State::Fault), word(State::Fault)], [Controlword::DISABLE_VOLTAGE; 2]);
    }

    #[test]
    fn a_dropped_drive_is_off_alone_until_it_is_reset() {
        let mut stages = PowerStages::new(3);
        stages.drop_drive(Joint::of::<3>());
        let goals = |stages: &PowerStages| {
            Joint::ALL.map(|joint| stages.goal(joint, ENABLED, Mode::ZeroTorque, true))
        };
        let (on, off) = (Goal::OperationEnabled, Goal::VoltageDisabled);
        assert_eq!(goals(&stages), [on, on, off, on, on, on]);
        stages.reset_faults();
        assert_eq!(goals(&stages), [on; 6]);
    }

    #[test]
    fn every_silent_drive_is_told_once_and_one_a_cycle() {
        let mut stages = PowerStages::new(3);
        let fresh = [true, false, true, false, true, true];
        let mut cycle = |is_stopped| stages.next_silent(fresh, is_stopped);
        assert_eq!([cycle(false), cycle(false), cycle(false)], [None; 3], "nothing has stopped");
        let (second, fourth) = (Joint::of::<2>(), Joint::of::<4>());
        assert_eq!([cycle(true), cycle(true), cycle(true)], [Some(second), Some(fourth), None]);
        assert_eq!(stages.goal(second, ENABLED, Mode::ZeroTorque, true), Goal::VoltageDisabled);
        assert_eq!(stages.goal(FIRST, ENABLED, Mode::ZeroTorque, true), Goal::OperationEnabled);
    }
}
