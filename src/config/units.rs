//! Keys of a joint whose unit depends on its kind: revolute or prismatic.

use crate::problem::Problems;
use crate::value::{HasPlace, Optional};
use controller::arm::JointKind;

/// Selector of the keys that apply to the kind of a joint.
pub(super) struct Units<'p, 't> {
    pub(super) kind: JointKind,
    pub(super) problems: &'p mut Problems<'t>,
}

impl Units<'_, '_> {
    /// Returns the required key for this kind; the key for the other kind must be absent.
    pub(super) fn either<'v, T>(
        &mut self,
        revolute: &'v Optional<T>,
        prismatic: &'v Optional<T>,
    ) -> Option<&'v Optional<T>> {
        let value = self.at_most_one(revolute, prismatic)?;
        if value.is_absent() {
            let reason = format!("missing field `{}`", value.place().name());
            self.problems.add(value, reason);
        }
        Some(value)
    }

    /// Returns the optional key for this kind; the key for the other kind must be absent.
    pub(super) fn at_most_one<'v, T>(
        &mut self,
        revolute: &'v Optional<T>,
        prismatic: &'v Optional<T>,
    ) -> Option<&'v Optional<T>> {
        let (value, misplaced, kind) = match self.kind {
            JointKind::Revolute => (revolute, prismatic, "revolute"),
            JointKind::Prismatic => (prismatic, revolute, "prismatic"),
        };
        if misplaced.as_ref().is_some() {
            let reason = format!("a {kind} joint has `{}`", value.place().name());
            self.problems.add(misplaced, reason);
            return None;
        }
        Some(value)
    }

    /// Converts a position or width from degrees or m, as in the file, to rad or m.
    pub(super) fn si(&self, typed: f64) -> f64 {
        match self.kind {
            JointKind::Revolute => typed.to_radians(),
            JointKind::Prismatic => typed,
        }
    }
}
