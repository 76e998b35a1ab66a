//! Content of the cyclic PDOs, as values.
//!
//! [`exchange`](crate::exchange) reads and writes their bits by the layout.

use thiserror::Error;

use crate::drive::Statusword;
use units::drive::{Counts, PerMille};
use units::numbering::NodeIndex;

/// PDO whose length differs from its mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("PDO must have {expected} bytes, got {found}")]
pub struct WrongLength {
    /// Node that sent it.
    pub node: NodeIndex,
    /// Length of the mapping, in bytes.
    pub expected: usize,
    /// Length received, in bytes.
    pub found: usize,
}

/// Last sample of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveSample {
    /// Statusword.
    pub statusword: Statusword,
    /// Position actual value at the SYNC.
    pub position: Counts,
    /// Torque actual value.
    pub torque: PerMille,
}
