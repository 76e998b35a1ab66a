//! Reasons why zeros were not set.

use std::time::Duration;

use derive_more::Display;
use thiserror::Error;

use crate::rest::NotAtRest;
use units::numbering::Joint;
use units::wording::in_one_line;

/// Part of the text of [`ZeroError::Moving`], by which a client knows that it may ask again.
pub const MOVING: &str = "each must be at rest for 1 s";

/// Reason why zeros were not set.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ZeroError {
    /// Joint whose drive is absolute, so that nothing is to be set.
    #[error("joint {joint} ({name}): nothing to set: zero = \"absolute\"")]
    Absolute {
        /// Joint of the request.
        joint: Joint,
        /// Its name.
        name: String,
    },
    /// No joint whose zero is to be set.
    #[error("nothing to set: every joint has zero = \"absolute\"")]
    AllAbsolute,
    /// Joints that have moved, or whose samples are missing.
    #[error("{}: {MOVING}, deadman open, hands off the grip", in_one_line(.0))]
    Moving(Vec<Moving>),
    /// Joints that do not read their rest position, whole revolutions aside.
    #[error(transparent)]
    NotAtRest(#[from] NotAtRest),
}

/// Joint that has not been at rest for long enough.
#[derive(Clone, Debug, Display, PartialEq)]
#[display("joint {joint} ({name}) has been at rest for {:.1} s", at_rest.as_secs_f64())]
pub struct Moving {
    pub(super) joint: Joint,
    pub(super) name: String,
    pub(super) at_rest: Duration,
}
