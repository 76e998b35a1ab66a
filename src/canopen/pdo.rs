//! What the cycle's PDOs carry, as values: a drive's sample.
//!
//! Where their bits are is the layout's business: [`exchange`](crate::exchange) reads and
//! writes the frames.

use thiserror::Error;

use crate::drive::Statusword;
use units::drive::Counts;
use units::drive::PerMille;

/// A PDO of another length than its mapping gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a PDO of {found} bytes, expected {expected}")]
pub struct WrongLength {
    /// Whose: a place in the list of plans.
    pub node: usize,
    /// What the mapping gives.
    pub expected: usize,
    /// What came.
    pub found: usize,
}

/// What a drive last told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveSample {
    /// Its state.
    pub statusword: Statusword,
    /// Where its encoder was at the SYNC.
    pub position: Counts,
    /// The torque it exerts.
    pub torque: PerMille,
}
