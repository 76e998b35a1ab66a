//! Reasons not to accept fitted friction.

use crate::fit::sample::Direction;
use crate::fit::sweep::law::{Estimate, JointFriction, Law};

/// Maximum share of outliers among the readings.
const MAX_OUTLIERS: f64 = 0.02;
/// Maximum relative uncertainty of Coulomb friction: the share that the compensation leaves uncompensated.
const MAX_UNCERTAINTY: f64 = 0.3;
/// Standard deviations that count as certain.
const CERTAIN: f64 = 2.0;
/// Negligible fall of friction over the sweep, relative to Coulomb friction.
const NEGLIGIBLE: f64 = 0.01;

/// Reason not to accept fitted friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrictionDoubt {
    /// Too many readings are outliers.
    Outliers {
        /// Number of outliers.
        found: usize,
        /// Number of readings.
        of: usize,
    },
    /// Coulomb friction is zero or negative: the torque acts with the motion.
    Negative {
        /// Coulomb friction, in N·m or N; at most zero.
        coulomb: f64,
    },
    /// Friction falls with speed.
    Falling {
        /// Direction; `None` for both together.
        direction: Option<Direction>,
        /// Viscous friction, in N·m·s/rad or N·s/m.
        viscous: Estimate,
    },
    /// Coulomb friction that the readings do not determine.
    Uncertain {
        /// Two standard deviations relative to Coulomb friction.
        share: f64,
    },
}

impl JointFriction {
    /// Returns the doubts that follow from the readings, the most obvious first.
    pub fn doubts(&self) -> Vec<FrictionDoubt> {
        let coulomb = self.both.coulomb;
        let (found, kept) = (self.outliers.len(), self.both.readings);
        let of = kept.saturating_add(found);
        let is_excess = count(found) > MAX_OUTLIERS * count(of);
        let share = CERTAIN * coulomb.deviation / coulomb.value;
        let laws = [
            (Some(Direction::Up), &self.up),
            (Some(Direction::Down), &self.down),
            (None, &self.both),
        ];
        let falling = laws
            .into_iter()
            .filter(|(_, law)| self.is_falling(law))
            .map(|(direction, law)| FrictionDoubt::Falling { direction, viscous: law.viscous });
        let is_negative = coulomb.value <= 0.0;
        let doubts = [
            is_excess.then_some(FrictionDoubt::Outliers { found, of }),
            is_negative.then_some(FrictionDoubt::Negative { coulomb: coulomb.value }),
            (!is_negative && share > MAX_UNCERTAINTY).then_some(FrictionDoubt::Uncertain { share }),
        ];
        let falling: Vec<FrictionDoubt> = if is_negative { Vec::new() } else { falling.collect() };
        doubts.into_iter().flatten().chain(falling).collect()
    }

    /// Returns whether friction falls by more than noise and by more than the negligible share.
    fn is_falling(&self, law: &Law) -> bool {
        let noise = CERTAIN * law.viscous.deviation;
        let negligible = NEGLIGIBLE * self.both.coulomb.value.abs() / self.fastest;
        law.viscous.value < -noise.max(negligible)
    }
}

impl FrictionDoubt {
    /// Returns reason and remedy, with torques in `unit` and viscous friction in `viscous_unit`.
    pub fn reason(&self, unit: &str, viscous_unit: &str) -> String {
        match *self {
            Self::Outliers { found, of } => format!(
                "{found} of {of} readings are outliers, at most 2 % may be; record their lines again"
            ),
            Self::Negative { coulomb } => format!(
                "Coulomb friction is {coulomb:.4} {unit}: the torque is larger downwards than upwards; check the sign \
                 of the velocity, and gear_ratio"
            ),
            Self::Falling { direction, viscous } => format!(
                "friction{} falls with speed, by {:.4} ± {:.4} {viscous_unit}; leave out the slowest speeds, and let \
                 each speed settle",
                direction.map_or(String::new(), |direction| format!(" {direction}")),
                -viscous.value,
                viscous.deviation
            ),
            Self::Uncertain { share } => format!(
                "Coulomb friction is known to ±{:.0} % only, at most 30 % are of use; mend gravity if it is off, \
                 or record more readings",
                100.0 * share
            ),
        }
    }
}

/// Converts a number of readings to `f64`; infinity beyond `u32`.
fn count(readings: usize) -> f64 {
    u32::try_from(readings).map_or(f64::INFINITY, f64::from)
}
