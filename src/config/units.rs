//! Keys of a joint that stand in one unit where it turns and in another where it slides.

use crate::problem::Problems;
use crate::value::Optional;
use crate::value::Placed;
use controller::arm::JointKind;

/// Keys of which a turning joint has the first and a sliding one the second.
pub(super) struct Units<'p, 't> {
    pub(super) kind: JointKind,
    pub(super) problems: &'p mut Problems<'t>,
}

impl Units<'_, '_> {
    /// The one of the two that must be there.
    pub(super) fn either<'v, T>(
        &mut self,
        turning: &'v Optional<T>,
        sliding: &'v Optional<T>,
    ) -> Option<&'v Optional<T>> {
        let value = self.at_most_one(turning, sliding)?;
        if value.is_absent() {
            let reason = format!("missing field `{}`", value.place().name());
            self.problems.add(value, reason);
        }
        Some(value)
    }

    /// The one of the two that may be there; the other must not.
    pub(super) fn at_most_one<'v, T>(
        &mut self,
        turning: &'v Optional<T>,
        sliding: &'v Optional<T>,
    ) -> Option<&'v Optional<T>> {
        let (value, misplaced, kind) = match self.kind {
            JointKind::Revolute => (turning, sliding, "revolute"),
            JointKind::Prismatic => (sliding, turning, "prismatic"),
        };
        if misplaced.as_ref().is_some() {
            let reason = format!("a {kind} joint has `{}`", value.place().name());
            self.problems.add(misplaced, reason);
            return None;
        }
        Some(value)
    }

    /// A position or width in rad or m: angles are typed in degrees.
    pub(super) fn si(&self, typed: f64) -> f64 {
        match self.kind {
            JointKind::Revolute => typed.to_radians(),
            JointKind::Prismatic => typed,
        }
    }
}
