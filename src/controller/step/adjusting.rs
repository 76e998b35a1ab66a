//! Adjustments in the cycle: preconditions of a change, and its effect on the object's reference.

use nalgebra::Isometry3;

use super::Controller;
use crate::Settings;
use crate::adjustment::{AdjustmentError, AdjustmentState, is_contact, is_contact_on};
use crate::alignment::Alignment;
use crate::command::{CommandLaw, Gate};
use crate::reference::Displacement;
use crate::switches::CommandMode;
use units::adjustment::{Adjustment, LockAxis};

impl Controller {
    /// Applies an adjustment of the operator.
    ///
    /// # Errors
    /// Returns the reason if the adjustment is out of bounds, or not permitted in the state of the last cycle. The
    /// state is then unchanged.
    pub fn adjust(&mut self, adjustment: Adjustment) -> Result<(), AdjustmentError> {
        let bounds = &self.settings.bounds;
        match adjustment {
            Adjustment::Scale(quantity, factor) => {
                bounds.check_scale(quantity, factor)?;
                self.scaling.set(quantity, factor);
            }
            Adjustment::Lock(axis, is_locked) => {
                let yields = self.mode == CommandMode::Rate && axis.entry(&bounds.yields);
                let commands = self.gate == Gate::Open && yields;
                if is_locked && commands && is_contact_on(&self.f_m_sensed, axis) {
                    return Err(AdjustmentError::HoldsContact { axis });
                }
                self.scaling.lock(axis, is_locked);
            }
            Adjustment::Align => {
                self.check_alignment()?;
                self.alignment = Some(Alignment::default());
            }
        }
        Ok(())
    }

    /// Returns the state of scales, locks and alignment.
    pub const fn adjusted(&self) -> AdjustmentState {
        AdjustmentState::new(&self.scaling, self.alignment.is_some())
    }

    /// Checks the preconditions of an alignment.
    fn check_alignment(&self) -> Result<(), AdjustmentError> {
        let locked = LockAxis::ALL.into_iter().filter(|axis| axis.is_rotation());
        match (self.mode, self.gate) {
            (CommandMode::Rate, _) => Err(AdjustmentError::NotPose),
            (CommandMode::Pose, Gate::Released | Gate::Waiting | Gate::TurnedTooFar) => {
                Err(AdjustmentError::NotCommanding)
            }
            (CommandMode::Pose, Gate::Open) if is_contact(&self.f_m_sensed) => {
                Err(AdjustmentError::InContact)
            }
            (CommandMode::Pose, Gate::Open) => {
                match locked.into_iter().find(|axis| axis.entry(self.scaling.locked())) {
                    Some(axis) => Err(AdjustmentError::Locked { axis }),
                    None => Ok(()),
                }
            }
        }
    }

    /// Returns the law with the factors of this cycle. In pose mode it adapts the object's reference to a change, so that
    /// the commanded pose does not jump.
    pub(super) fn scaled(
        &mut self,
        law: &CommandLaw,
        mode: CommandMode,
        dx_db: &Displacement,
    ) -> CommandLaw {
        let before = law.scaled(&self.scaling.factors().command);
        if !self.scaling.advance() {
            return before;
        }
        let now = law.scaled(&self.scaling.factors().command);
        if mode == CommandMode::Pose {
            let interpretation = &self.settings.interpretation;
            let x_b_d = before.pose(interpretation, &self.reference, dx_db);
            self.reference.x_b_r = now.reference(interpretation, &x_b_d, dx_db);
        }
        now
    }

    /// Advances an alignment by one cycle. It ends when the operator does not command, in contact, or with a locked rotation.
    pub(super) fn align(
        &mut self,
        law: &CommandLaw,
        commanding: Option<CommandMode>,
        x_0_g: &Isometry3<f64>,
        dx_db: &Displacement,
    ) {
        let Some(mut alignment) = self.alignment.take() else { return };
        let [_, _, _, rx, ry, rz] = *self.scaling.locked();
        let is_posing = commanding == Some(CommandMode::Pose);
        if !is_posing || is_contact(&self.f_m_sensed) || rx || ry || rz {
            return;
        }
        let Settings { interpretation, period, .. } = &self.settings;
        let mut x_b_d = law.pose(interpretation, &self.reference, dx_db);
        let (rotation, is_done) = alignment.next(*period, &x_b_d.rotation, &x_0_g.rotation);
        x_b_d.rotation = rotation;
        self.reference.x_b_r = law.reference(interpretation, &x_b_d, dx_db);
        self.alignment = (!is_done).then_some(alignment);
    }
}
