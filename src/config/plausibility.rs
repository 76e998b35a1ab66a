//! What of `[safety]` is about samples: what a joint may do before its drive is not believed.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
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

/// The keys, or what they are without being written.
pub(super) fn read(raw: &raw::Safety, problems: &mut Problems<'_>) -> Plausibility {
    let grip = raw.max_grip_speed_m_per_s.unwrap_or(1.0);
    let turning = raw.limit_margin_rad.unwrap_or(0.02);
    let sliding = raw.limit_margin_m.unwrap_or(0.01);
    let tolerance = raw.torque_tolerance_per_mille.unwrap_or(150);
    let differs_ms = raw.torque_differs_ms.unwrap_or(50);
    let frozen_ms = raw.frozen_ms.unwrap_or(500);
    let missing = raw.max_missing_percent.unwrap_or(5);
    let turns = usual_speed(raw, JointKind::Revolute);
    problems.within("safety.max_joint_speed_rad_per_s", turns, SPEEDS);
    let slides = usual_speed(raw, JointKind::Prismatic);
    problems.within("safety.max_joint_speed_m_per_s", slides, SPEEDS);
    problems.within("safety.torque_differs_ms", differs_ms, 1..=1_000);
    problems.within("safety.frozen_ms", frozen_ms, 10..=10_000);
    Plausibility {
        max_grip_speed: problems.within("safety.max_grip_speed_m_per_s", grip, 0.01..=10.0),
        limit_margin_turning: problems.within("safety.limit_margin_rad", turning, 0.0..=0.5),
        limit_margin_sliding: problems.within("safety.limit_margin_m", sliding, 0.0..=0.1),
        torque_tolerance: problems.within(
            "safety.torque_tolerance_per_mille",
            tolerance,
            1..=1_000,
        ),
        torque_differs: Duration::from_millis(differs_ms),
        frozen: Duration::from_millis(frozen_ms),
        max_missing_percent: problems.within("safety.max_missing_percent", missing, 1..=50),
    }
}

/// How fast a joint of a kind may move, in rad/s or m/s, where the joint itself does not say.
pub(super) fn usual_speed(raw: &raw::Safety, kind: JointKind) -> f64 {
    match kind {
        JointKind::Revolute => raw.max_joint_speed_rad_per_s.unwrap_or(10.0),
        JointKind::Prismatic => raw.max_joint_speed_m_per_s.unwrap_or(1.0),
    }
}

/// Speeds that a joint may be allowed, in rad/s or m/s.
pub(super) const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;
