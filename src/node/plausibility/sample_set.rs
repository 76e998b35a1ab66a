//! Samples of one cycle, input of the plausibility checks.

use canopen::pdo::DriveSample;
use units::drive::PerMille;
use units::time::Instant;

/// Samples of one cycle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleSet<'s> {
    /// Time at which its SYNC was sent.
    pub(crate) at: Instant,
    /// Newest sample of each joint.
    pub(crate) latest: &'s [DriveSample; 6],
    /// Joints whose positions are of this SYNC.
    pub(crate) fresh: [bool; 6],
    /// Joints whose torque was received since the last cycle.
    pub(crate) torques: [bool; 6],
    /// Torque demands (6074h) received since the last cycle.
    pub(crate) demands: [Option<PerMille>; 6],
}
