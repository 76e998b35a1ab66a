//! `[safety]`, as far as it is about samples: bounds beyond which a sample is implausible.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
use crate::value::Value;
use controller::arm::JointKind;

/// Bounds of the samples of a whole arm.
#[derive(Clone, Copy, Debug)]
pub struct Plausibility {
    /// Maximum speed of the grip, in m/s.
    pub max_grip_speed: f64,
    /// Margin beyond the range of a joint that turns, in rad.
    pub limit_margin_turning: f64,
    /// The same of one that slides, in m.
    pub limit_margin_sliding: f64,
    /// By how much a drive's torque may differ from what it is told, in ‰ of rated torque.
    pub torque_tolerance: u16,
    /// For how long it may differ by more.
    pub torque_differs: Duration,
    /// For how long a position may stand still under torque.
    pub frozen: Duration,
    /// Maximum share of a joint's samples missing within a second, in percent.
    pub max_missing_percent: u32,
}

impl Plausibility {
    /// Margin beyond the range of a joint of this kind, in rad or m.
    pub const fn limit_margin(&self, kind: JointKind) -> f64 {
        match kind {
            JointKind::Revolute => self.limit_margin_turning,
            JointKind::Prismatic => self.limit_margin_sliding,
        }
    }
}

/// The keys, or what they are without being written; `None` where a problem has been noted.
pub(super) fn read(raw: &raw::Safety, problems: &mut Problems<'_>) -> Option<Plausibility> {
    for kind in [JointKind::Revolute, JointKind::Prismatic] {
        problems.within(&usual_speed(raw, kind), SPEEDS);
    }
    let differs_ms = problems.within(&raw.torque_differs_ms.or(50), 1..=1_000);
    let frozen_ms = problems.within(&raw.frozen_ms.or(500), 10..=10_000);
    let grip = problems.within(&raw.max_grip_speed_m_per_s.or(1.0), 0.01..=10.0);
    let turning = problems.within(&raw.limit_margin_rad.or(0.02), 0.0..=0.5);
    let sliding = problems.within(&raw.limit_margin_m.or(0.01), 0.0..=0.1);
    let tolerance = problems.within(&raw.torque_tolerance_per_mille.or(150), 1..=1_000);
    let missing = problems.within(&raw.max_missing_percent.or(5), 1..=50);
    Some(Plausibility {
        max_grip_speed: grip?,
        limit_margin_turning: turning?,
        limit_margin_sliding: sliding?,
        torque_tolerance: tolerance?,
        torque_differs: Duration::from_millis(differs_ms?),
        frozen: Duration::from_millis(frozen_ms?),
        max_missing_percent: missing?,
    })
}

/// Maximum speed of a joint of a kind, in rad/s or m/s, where the joint itself does not say.
pub(super) fn usual_speed(raw: &raw::Safety, kind: JointKind) -> Value<f64> {
    match kind {
        JointKind::Revolute => raw.max_joint_speed_rad_per_s.or(10.0),
        JointKind::Prismatic => raw.max_joint_speed_m_per_s.or(1.0),
    }
}

/// Speeds that a joint may be allowed, in rad/s or m/s.
pub(super) const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;
