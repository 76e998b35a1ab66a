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
    /// Sender of the PDO.
    pub node: NodeIndex,
    /// Length of the mapping, in bytes.
    pub expected: usize,
    /// Length received, in bytes.
    pub found: usize,
}

/// Last sample of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveSample {
    /// Statusword (6041h).
    pub statusword: Statusword,
    /// Position actual value at the SYNC.
    pub position: Counts,
    /// Torque actual value (6077h), in ‰ of rated torque.
    pub torque: PerMille,
}
