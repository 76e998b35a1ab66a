//! Limit of the contact wrench of an arm, and the twists that it permits above the limit.
//!
//! ```text
//!  each part above its limit      v = v - f̂ min(0, f̂ · v)           ω = ω - m̂ min(0, m̂ · ω)
//!  then the whole wrench          v = v - f min(0, P) / (c F²)       ω = ω - m min(0, P) / (c M²)
//!
//!  P = f · v + m · ω,  c = f² / F² + m² / M²,  limits F and M
//! ```
//!
//! The second line covers a contact offset from {MRF}, where a rotation penetrates deeper with a moment within the limit.
//! Deeper penetration requires negative power P.

use nalgebra::Vector3;

use units::spatial::{Twist, Wrench};

/// Maximum wrench after a reset above the limit, relative to its minimum since, so that sensor noise does not stop the arm.
const MAX_RISE: f64 = 1.05;

/// Maximum contact wrench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchLimit {
    /// Maximum force, in N.
    pub force: f64,
    /// Maximum moment, in N·m.
    pub moment: f64,
}

impl WrenchLimit {
    /// No limit.
    pub const NONE: Self = Self { force: f64::INFINITY, moment: f64::INFINITY };

    /// Returns whether a wrench is within the limit; NaN is not.
    pub fn allows(&self, f: &Wrench) -> bool {
        f.force.norm() <= self.force && f.moment.norm() <= self.moment
    }

    /// Returns the limit after a reset at wrench `f`: 5 % above each part that exceeds its limit.
    pub(crate) fn after_reset_at(&self, f: &Wrench) -> Self {
        let part = |limit: f64, now: f64| if now > limit { MAX_RISE * now } else { limit };
        let Self { force, moment } = *self;
        Self { force: part(force, f.force.norm()), moment: part(moment, f.moment.norm()) }
    }

    /// Removes from a twist the part that moves deeper into a contact with wrench `f` above the limit. Motion out and
    /// sideways remains. Within the limit the twist is unchanged.
    pub fn without_advance(&self, v: &Twist, f: &Wrench) -> Twist {
        if self.allows(f) {
            return *v;
        }
        let linear = unopposed(&v.linear, &f.force, self.force);
        let angular = unopposed(&v.angular, &f.moment, self.moment);
        let v = Twist { linear, angular };
        let along = Twist {
            linear: f.force / (self.force * self.force),
            angular: f.moment / (self.moment * self.moment),
        };
        v + along * (-f.power(&v).min(0.0) / f.power(&along))
    }

    /// Returns the lower limit of force and moment.
    pub(crate) const fn min(self, other: Self) -> Self {
        Self { force: self.force.min(other.force), moment: self.moment.min(other.moment) }
    }
}

/// Removes from a velocity its component against a part of the wrench that is above its limit.
fn unopposed(velocity: &Vector3<f64>, part: &Vector3<f64>, limit: f64) -> Vector3<f64> {
    if part.norm() <= limit {
        return *velocity;
    }
    let direction = part.normalize();
    velocity - direction * direction.dot(velocity).min(0.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LIMIT: WrenchLimit = WrenchLimit { force: 50.0, moment: 5.0 };

    /// Rounding tolerance of a power, in W.
    const ROUNDING: f64 = 1e-9;

    fn six(force: f64, moment: f64) -> impl Strategy<Value = [f64; 6]> {
        let (force, moment) = (-force..force, -moment..moment);
        [force.clone(), force.clone(), force, moment.clone(), moment.clone(), moment]
    }

    fn wrench() -> impl Strategy<Value = Wrench> {
        six(80.0, 8.0).prop_map(Wrench::from_components)
    }

    fn twist() -> impl Strategy<Value = Twist> {
        six(1.0, 3.0).prop_map(Twist::from_components)
    }

    proptest! {
        #[test]
        fn twist_within_the_limit_is_unchanged(v in twist(), f in wrench()) {
            let f = f * (1.0_f64).min(LIMIT.force / f.force.norm()).min(LIMIT.moment / f.moment.norm());
            let f = f * 0.999;
            prop_assert!(LIMIT.allows(&f));
            prop_assert_eq!(LIMIT.without_advance(&v, &f), v);
        }

        #[test]
        fn no_part_above_its_limit_is_worked_against(v in twist(), f in wrench()) {
            prop_assume!(!LIMIT.allows(&f));
            let left = LIMIT.without_advance(&v, &f);
            prop_assert!(f.power(&left) >= -ROUNDING, "{}", f.power(&left));
            if f.force.norm() > LIMIT.force {
                prop_assert!(f.force.dot(&left.linear) >= -ROUNDING);
            }
            if f.moment.norm() > LIMIT.moment {
                prop_assert!(f.moment.dot(&left.angular) >= -ROUNDING);
            }
        }

        #[test]
        fn outward_and_sideways_twists_are_unchanged(v in twist(), f in wrench()) {
            let out = |v: Vector3<f64>, part: &Vector3<f64>| if v.dot(part) < 0.0 { -v } else { v };
            let outward =
                Twist { linear: out(v.linear, &f.force), angular: out(v.angular, &f.moment) };
            let sideways =
                Twist { linear: v.linear.cross(&f.force), angular: v.angular.cross(&f.moment) };
            for v in [outward, sideways] {
                let change = LIMIT.without_advance(&v, &f) + v * -1.0;
                prop_assert!(change.components().iter().all(|part| part.abs() < ROUNDING), "{change:?}");
            }
        }
    }

    #[test]
    fn turn_into_a_contact_beside_the_tool_is_stopped() {
        // 60 N at 5 cm: the moment, 3 N·m, is within its limit.
        let f = Wrench::from_components([0.0, 0.0, -60.0, 0.0, 3.0, 0.0]);
        let v = Twist::from_components([0.0, 0.0, 0.0, 0.2, -1.0, 0.3]);
        let left = LIMIT.without_advance(&v, &f);
        assert!(f.power(&left).abs() < ROUNDING, "{left:?}");
        assert!(left.linear.z < 0.0, "it gives way instead: {left:?}");
        assert_eq!((left.angular.x, left.angular.z), (0.2, 0.3));
    }

    #[test]
    fn limit_of_one_part_alone_leaves_no_power() {
        let limit = WrenchLimit { moment: f64::INFINITY, ..LIMIT };
        let f = Wrench::from_components([0.0, 0.0, -60.0, 0.0, 3.0, 0.0]);
        let left =
            limit.without_advance(&Twist::from_components([0.0, 0.0, 1.0, 0.0, -1.0, 0.0]), &f);
        assert!(f.power(&left) >= -ROUNDING, "{left:?}");
    }
}
