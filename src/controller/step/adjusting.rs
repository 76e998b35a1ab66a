//! Adjustments in the cycle: when a change is taken, and how the object's reference moves along with it.

use nalgebra::Isometry3;

use super::Controller;
use crate::Settings;
use crate::adjustment::{Adjusted, AdjustmentRefused, is_contact, is_contact_on};
use crate::alignment::Alignment;
use crate::command::{CommandLaw, Gate};
use crate::reference::Displacement;
use crate::switches::Mode;
use units::adjustment::{Adjustment, LockAxis};

impl Controller {
    /// Takes a change that the operator makes while running.
    ///
    /// # Errors
    /// A change that is out of bounds, or not possible in the state of the last cycle. Nothing is changed then.
    pub fn adjust(&mut self, adjustment: Adjustment) -> Result<(), AdjustmentRefused> {
        let bounds = &self.settings.bounds;
        match adjustment {
            Adjustment::Scale(quantity, factor) => {
                bounds.check_scale(quantity, factor)?;
                self.scaling.set(quantity, factor);
            }
            Adjustment::Lock(axis, is_locked) => {
                let yields = self.mode == Mode::Rate && axis.entry(&bounds.yields);
                let commands = self.gate == Gate::Open && yields;
                if is_locked && commands && is_contact_on(&self.f_m_sensed, axis) {
                    return Err(AdjustmentRefused::HoldsContact { axis });
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
    pub const fn adjusted(&self) -> Adjusted {
        Adjusted::new(&self.scaling, self.alignment.is_some())
    }

    /// Checks that the object may be turned.
    fn check_alignment(&self) -> Result<(), AdjustmentRefused> {
        let locked = LockAxis::ALL.into_iter().filter(|axis| axis.is_rotation());
        match (self.mode, self.gate) {
            (Mode::Rate, _) => Err(AdjustmentRefused::NotPose),
            (Mode::Pose, Gate::Released | Gate::Waiting | Gate::TurnedTooFar) => {
                Err(AdjustmentRefused::NotCommanding)
            }
            (Mode::Pose, Gate::Open) if is_contact(&self.f_m_sensed) => {
                Err(AdjustmentRefused::InContact)
            }
            (Mode::Pose, Gate::Open) => {
                match locked.into_iter().find(|axis| axis.entry(self.scaling.locked())) {
                    Some(axis) => Err(AdjustmentRefused::Locked { axis }),
                    None => Ok(()),
                }
            }
        }
    }

    /// Returns the law with the factors of this cycle. The object's reference moves along with a change, so that no pose jumps.
    pub(super) fn scaled(
        &mut self,
        law: &CommandLaw,
        mode: Mode,
        dx_db: &Displacement,
    ) -> CommandLaw {
        let before = law.scaled(&self.scaling.factors().command);
        if !self.scaling.advance() {
            return before;
        }
        let now = law.scaled(&self.scaling.factors().command);
        if mode == Mode::Pose {
            let interpretation = &self.settings.interpretation;
            let x_b_d = before.pose(interpretation, &self.reference, dx_db);
            self.reference.x_b_r = now.reference(interpretation, &x_b_d, dx_db);
        }
        now
    }

    /// Turns the object's reference by a cycle of an alignment. It ends where the operator does not command, or in contact.
    pub(super) fn align(
        &mut self,
        law: &CommandLaw,
        commanding: Option<Mode>,
        x_0_g: &Isometry3<f64>,
        dx_db: &Displacement,
    ) {
        let Some(mut alignment) = self.alignment.take() else { return };
        let [_, _, _, rx, ry, rz] = self.scaling.locked();
        if commanding != Some(Mode::Pose) || is_contact(&self.f_m_sensed) || *rx || *ry || *rz {
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
