//! `[safety]`: bounds of plausible samples.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
use crate::value::Value;
use controller::arm::JointKind;

/// Bounds of plausible positions, speeds and torques of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Plausibility {
    /// Maximum speed of the grip, in m/s.
    pub max_grip_speed: f64,
    /// Margin beyond the range of a revolute joint, in rad.
    pub limit_margin_revolute: f64,
    /// Margin beyond the range of a prismatic joint, in m.
    pub limit_margin_prismatic: f64,
    /// Maximum difference of actual (6077h) and target torque (6071h), in ‰ of rated torque; `None` for a range derived
    /// from the targets.
    pub torque_tolerance: Option<u16>,
    /// Time for which a larger difference is tolerated.
    pub torque_differs: Duration,
    /// Time for which a position may be constant under torque.
    pub frozen: Duration,
    /// Maximum share of a joint's samples missing within a second, in percent.
    pub max_missing_percent: u32,
}

impl Plausibility {
    /// Returns the margin beyond the range of a joint of this kind, in rad or m.
    pub const fn limit_margin(&self, kind: JointKind) -> f64 {
        match kind {
            JointKind::Revolute => self.limit_margin_revolute,
            JointKind::Prismatic => self.limit_margin_prismatic,
        }
    }
}

/// Reads the bounds, with defaults for absent keys. Returns `None` after a problem.
pub(super) fn read(raw: &raw::Safety, problems: &mut Problems<'_>) -> Option<Plausibility> {
    for kind in [JointKind::Revolute, JointKind::Prismatic] {
        problems.within(&default_speed(raw, kind), MAX_SPEED_RANGE);
    }
    let differs_ms = problems.within(&raw.torque_differs_ms.or(50), 1..=1_000);
    let frozen_ms = problems.within(&raw.frozen_ms.or(500), 10..=10_000);
    let grip = problems.within(&raw.max_grip_speed_m_per_s.or(1.0), 0.01..=10.0);
    let turning = problems.within(&raw.limit_margin_rad.or(0.02), 0.0..=0.5);
    let sliding = problems.within(&raw.limit_margin_m.or(0.01), 0.0..=0.1);
    let tolerance = match &raw.torque_tolerance_per_mille {
        given if given.is_absent() => Some(None),
        given => problems.within(&given.or(1), 1..=1_000).map(Some),
    };
    let missing = problems.within(&raw.max_missing_percent.or(5), 1..=50);
    Some(Plausibility {
        max_grip_speed: grip?,
        limit_margin_revolute: turning?,
        limit_margin_prismatic: sliding?,
        torque_tolerance: tolerance?,
        torque_differs: Duration::from_millis(differs_ms?),
        frozen: Duration::from_millis(frozen_ms?),
        max_missing_percent: missing?,
    })
}

/// Returns the default maximum speed of a joint of this kind, in rad/s or m/s.
pub(super) fn default_speed(raw: &raw::Safety, kind: JointKind) -> Value<f64> {
    match kind {
        JointKind::Revolute => raw.max_joint_speed_rad_per_s.or(10.0),
        JointKind::Prismatic => raw.max_joint_speed_m_per_s.or(1.0),
    }
}

/// Range of a joint's maximum speed, in rad/s or m/s.
pub(super) const MAX_SPEED_RANGE: std::ops::RangeInclusive<f64> = 0.01..=100.0;
