//! Limit of the contact wrench of an arm.

use units::spatial::Wrench;

/// Maximum wrench after a reset above the limit, over the lowest one since: noise of the sensor does not stop the arm again.
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

    /// Returns whether a wrench is within it; NaN is not.
    pub fn allows(&self, f: &Wrench) -> bool {
        f.force.norm() <= self.force && f.moment.norm() <= self.moment
    }

    /// Returns the limit for an arm that is reset at a wrench: each part above its limit may rise by 5 %.
    pub(crate) fn after_reset_at(&self, f: &Wrench) -> Self {
        let part = |limit: f64, now: f64| if now > limit { MAX_RISE * now } else { limit };
        let Self { force, moment } = *self;
        Self { force: part(force, f.force.norm()), moment: part(moment, f.moment.norm()) }
    }

    /// Returns the lower limit of each part.
    pub(crate) const fn min(self, other: Self) -> Self {
        Self { force: self.force.min(other.force), moment: self.moment.min(other.moment) }
    }
}
