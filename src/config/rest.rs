//! `[[joint]] rest_deg` and `rest_m`: the rest posture, in which an arm must be armed first after each boot.
//!
//! It verifies sign and position scale, before any torque, where no object of the drive does. A joint that rests at `r`
//! within the tolerance `e` is read as `f (r + e)` with a wrong factor `f`. For f = -1, 1/2, 2 and 10 the reading is out
//! of tolerance if |r| > 3 e. The required distance from zero is 4 e.
//!
//! Where the rest posture sets the zero, the reading fits it whatever the factor. A second posture verifies that joint.

use std::fmt;

use crate::raw;
use crate::units::Units;
use crate::value::Optional;
use crate::zero::ZeroSource;
use controller::arm::JointKind;

/// Tolerance of a revolute joint, in rad: 5°.
const ROTATION_TOLERANCE: f64 = 5.0_f64.to_radians();

/// Tolerance of a prismatic joint, in m.
const TRANSLATION_TOLERANCE: f64 = 0.01;

/// Tolerance of a revolute joint whose zero is the cradle's, in rad: 1°.
const ZERO_ROTATION_TOLERANCE: f64 = 1.0_f64.to_radians();

/// Tolerance of a prismatic joint whose zero is the cradle's, in m.
const ZERO_TRANSLATION_TOLERANCE: f64 = 0.002;

/// Minimum distance of rest from zero, in tolerances, if only the rest posture verifies sign or scale.
pub(super) const MIN_DISTANCE: f64 = 4.0;

/// Rest position of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    kind: JointKind,
    /// In rad or m.
    position: f64,
    /// In rad or m.
    tolerance: f64,
}

impl Rest {
    /// Returns the position, in rad or m.
    pub const fn position(&self) -> f64 {
        self.position
    }

    /// Returns the tolerance, in rad or m.
    pub const fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Returns whether a joint at `q`, in rad or m, is within tolerance of rest; false for NaN.
    pub fn contains(&self, q: f64) -> bool {
        (q - self.position).abs() <= self.tolerance
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
        let within = self.format(self.tolerance);
        write!(f, "{}, within {within}", self.format(self.position))
    }
}

pub(super) const fn key_of(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "rest_deg",
        JointKind::Prismatic => "rest_m",
    }
}

/// Returns the default of the tolerance, which is also its maximum.
const fn default_tolerance(kind: JointKind, source: ZeroSource) -> f64 {
    match (kind, source) {
        (JointKind::Revolute, ZeroSource::Rest) => ZERO_ROTATION_TOLERANCE,
        (JointKind::Prismatic, ZeroSource::Rest) => ZERO_TRANSLATION_TOLERANCE,
        (JointKind::Revolute, _) => ROTATION_TOLERANCE,
        (JointKind::Prismatic, _) => TRANSLATION_TOLERANCE,
    }
}

/// Reads the rest position of a joint, which must be within `range`. Returns `None` if absent, or after a problem.
pub(super) fn read(
    joint: &raw::Joint,
    range: [f64; 2],
    source: ZeroSource,
    of: &mut Units<'_, '_>,
) -> Option<Rest> {
    let tolerance = tolerance(joint, source, of)?;
    let given = of.at_most_one(&joint.rest_deg, &joint.rest_m)?;
    position(given, range, tolerance, of)
}

/// Reads the second rest position of a joint, as [`read`].
pub(super) fn read_second(
    joint: &raw::Joint,
    range: [f64; 2],
    source: ZeroSource,
    of: &mut Units<'_, '_>,
) -> Option<Rest> {
    let given = of.at_most_one(&joint.second_rest_deg, &joint.second_rest_m)?;
    // A problem of the tolerance is noted with the first posture.
    let given_tolerance = joint.rest_tolerance_deg.get().or(joint.rest_tolerance_m.get());
    let tolerance =
        given_tolerance.map_or(default_tolerance(of.kind, source), |typed| of.si(typed));
    position(given, range, tolerance, of)
}

fn position(
    given: &Optional<f64>,
    range: [f64; 2],
    tolerance: f64,
    of: &mut Units<'_, '_>,
) -> Option<Rest> {
    if given.is_absent() {
        return None;
    }
    let typed = of.problems.finite(given)?;
    let position = of.si(typed);
    let [low, high] = range;
    if !(low..=high).contains(&position) {
        of.problems.add(given, "the joint would rest out of its range");
    }
    Some(Rest { kind: of.kind, position, tolerance })
}

/// Reads the tolerance, in rad or m. Returns `None` after a problem.
fn tolerance(joint: &raw::Joint, source: ZeroSource, of: &mut Units<'_, '_>) -> Option<f64> {
    let given = of.at_most_one(&joint.rest_tolerance_deg, &joint.rest_tolerance_m)?;
    let max = default_tolerance(of.kind, source);
    if given.is_absent() {
        return Some(max);
    }
    let typed = of.problems.positive(given)?;
    // The bound is given in degrees, which is not exact in rad.
    if of.si(typed) > max * (1.0 + 1e-9) {
        let (bound, unit) = match of.kind {
            JointKind::Revolute => (max.to_degrees().round(), "°"),
            JointKind::Prismatic => (max, " m"),
        };
        let source = source.key();
        let reason =
            format!("must be at most {bound}{unit} with zero = \"{source}\", got {typed}{unit}");
        of.problems.add(given, reason);
    }
    Some(of.si(typed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn posture_separates_wrong_factors_from_imprecise_placing() {
        for kind in [JointKind::Revolute, JointKind::Prismatic] {
            let tolerance = default_tolerance(kind, ZeroSource::Absolute);
            for position in [MIN_DISTANCE * tolerance, -MIN_DISTANCE * tolerance, 20.0 * tolerance]
            {
                let rest = Rest { kind, position, tolerance };
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
        let rest = Rest { kind: JointKind::Revolute, position: 1.0, tolerance: 0.1 };
        assert!(!rest.contains(f64::NAN) && !rest.contains(f64::INFINITY));
    }
}
