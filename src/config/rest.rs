//! `[[joint]] rest_deg` and `rest_m`: the rest posture, in which an arm must be armed first after each boot.
//!
//! It verifies sign and position scale, before any torque, where no object of the drive does. A joint that rests at `r`
//! within the tolerance `e` is read as `f (r + e)` with a wrong factor `f`. For f = -1, 1/2, 2 and 10 the reading is out
//! of tolerance if |r| > 3 e. The required distance from zero is 4 e.

use std::fmt;

use crate::raw;
use crate::units::Units;
use controller::arm::JointKind;

/// Tolerance of a revolute joint, in rad: 5°.
const ROTATION_TOLERANCE: f64 = 5.0_f64.to_radians();

/// Tolerance of a prismatic joint, in m.
const TRANSLATION_TOLERANCE: f64 = 0.01;

/// Minimum distance of rest from zero, in tolerances, if only the rest posture verifies sign or scale.
pub(super) const MIN_DISTANCE: f64 = 4.0;

/// Rest position of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    kind: JointKind,
    /// In rad or m.
    position: f64,
}

impl Rest {
    /// Returns whether the joint is revolute or prismatic, which decides unit and key.
    pub(super) const fn kind(&self) -> JointKind {
        self.kind
    }

    /// Returns the position, in rad or m.
    pub const fn position(&self) -> f64 {
        self.position
    }

    /// Returns whether a joint at `q`, in rad or m, is within tolerance of rest; false for NaN.
    pub fn contains(&self, q: f64) -> bool {
        (q - self.position).abs() <= tolerance(self.kind)
    }

    /// Formats a position of this joint: `95.0°` or `420 mm`.
    pub fn format(&self, q: f64) -> String {
        match self.kind {
            JointKind::Revolute => format!("{:.1}°", q.to_degrees()),
            JointKind::Prismatic => format!("{:.0} mm", q * 1e3),
        }
    }

    /// Returns the key of the configuration.
    pub const fn key(&self) -> &'static str {
        key_of(self.kind)
    }
}

/// `95.0°, within 5.0°`
impl fmt::Display for Rest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let within = self.format(tolerance(self.kind));
        write!(f, "{}, within {within}", self.format(self.position))
    }
}

pub(super) const fn key_of(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "rest_deg",
        JointKind::Prismatic => "rest_m",
    }
}

pub(super) const fn tolerance(kind: JointKind) -> f64 {
    match kind {
        JointKind::Revolute => ROTATION_TOLERANCE,
        JointKind::Prismatic => TRANSLATION_TOLERANCE,
    }
}

/// Reads the rest position of a joint, which must be within `range`. Returns `None` if absent, or after a problem.
pub(super) fn read(joint: &raw::Joint, range: [f64; 2], of: &mut Units<'_, '_>) -> Option<Rest> {
    let given = of.at_most_one(&joint.rest_deg, &joint.rest_m)?;
    if given.is_absent() {
        return None;
    }
    let typed = of.problems.finite(given)?;
    let position = of.si(typed);
    let [low, high] = range;
    if !(low..=high).contains(&position) {
        of.problems.add(given, "the joint would rest out of its range");
    }
    Some(Rest { kind: of.kind, position })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn posture_separates_wrong_factors_from_imprecise_placing() {
        for kind in [JointKind::Revolute, JointKind::Prismatic] {
            let tolerance = tolerance(kind);
            for position in [MIN_DISTANCE * tolerance, -MIN_DISTANCE * tolerance, 20.0 * tolerance]
            {
                let rest = Rest { kind, position };
                for placed in [-0.99, 0.0, 0.99].map(|share| position + share * tolerance) {
                    assert!(rest.contains(placed));
                    for factor in [-1.0, 0.5, 2.0, 10.0] {
                        assert!(!rest.contains(factor * placed), "{factor} times {placed}");
                    }
                }
            }
        }
    }

    #[test]
    fn unknown_position_is_not_at_rest() {
        let rest = Rest { kind: JointKind::Revolute, position: 1.0 };
        assert!(!rest.contains(f64::NAN) && !rest.contains(f64::INFINITY));
    }
}
