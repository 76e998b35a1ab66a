//! Keys of a joint that stand in one unit where it turns and in another where it slides.

use crate::problem::Problems;
use controller::arm::JointKind;

/// Keys of which a turning joint has the first and a sliding one the second.
pub(super) struct Units<'k, 'p, 't> {
    pub(super) key: &'k dyn Fn(&str) -> String,
    pub(super) kind: JointKind,
    pub(super) problems: &'p mut Problems<'t>,
}

impl Units<'_, '_, '_> {
    /// The value and its key, which must be there.
    pub(super) fn either<T>(
        &mut self,
        turning: (&'static str, Option<T>),
        sliding: (&'static str, Option<T>),
    ) -> Option<(&'static str, T)> {
        let (name, value) = self.at_most_one(turning, sliding)?;
        if value.is_none() {
            self.problems.add(&(self.key)(name), format_args!("missing field `{name}`"));
        }
        Some((name, value?))
    }

    /// The value, if there is one, and its key; the other kind's key must not be there.
    pub(super) fn at_most_one<T>(
        &mut self,
        turning: (&'static str, Option<T>),
        sliding: (&'static str, Option<T>),
    ) -> Option<(&'static str, Option<T>)> {
        let ((name, value), (other, misplaced), kind) = match self.kind {
            JointKind::Revolute => (turning, sliding, "revolute"),
            JointKind::Prismatic => (sliding, turning, "prismatic"),
        };
        if misplaced.is_some() {
            let reason = format!("a {kind} joint has `{name}`");
            self.problems.add(&(self.key)(other), reason);
            return None;
        }
        Some((name, value))
    }

    /// A position or width in rad or m: angles are typed in degrees.
    pub(super) fn si(&self, typed: f64) -> f64 {
        match self.kind {
            JointKind::Revolute => typed.to_radians(),
            JointKind::Prismatic => typed,
        }
    }
}
