//! What of `[safety]` is about samples: what a joint may do before its drive is not believed.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
use crate::value::Value;
use controller::arm::JointKind;

/// What the samples of a whole arm may be.
#[derive(Clone, Copy, Debug)]
pub struct Plausibility {
    /// How fast the grip may move, in m/s.
    pub max_grip_speed: f64,
    /// How far beyond its range a joint that turns may be, in rad.
    pub limit_margin_turning: f64,
    /// The same of one that slides, in m.
    pub limit_margin_sliding: f64,
    /// By how much a drive's torque may differ from what it is told, in ‰ of rated torque.
    pub torque_tolerance: u16,
    /// For how long it may differ by more.
    pub torque_differs: Duration,
    /// For how long a position may stand still under torque.
    pub frozen: Duration,
    /// How many of a joint's samples may be missing within a second, in percent.
    pub max_missing_percent: u32,
}

impl Plausibility {
    /// How far beyond its range a joint of this kind may be, in rad or m.
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

/// How fast a joint of a kind may move, in rad/s or m/s, where the joint itself does not say.
pub(super) fn usual_speed(raw: &raw::Safety, kind: JointKind) -> Value<f64> {
    match kind {
        JointKind::Revolute => raw.max_joint_speed_rad_per_s.or(10.0),
        JointKind::Prismatic => raw.max_joint_speed_m_per_s.or(1.0),
    }
}

/// Speeds that a joint may be allowed, in rad/s or m/s.
pub(super) const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;
