//! Report on a recording, for status and summary.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Number of parts of a recording, and the reason of its end.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordingReport {
    /// Number of parts so far.
    pub parts: u32,
    /// Reason why the recording ended before the run; `None` if it did not.
    pub ended_early: Option<String>,
}

/// Formats as `3 parts; ended early: the limit of 100 GB is reached`.
impl fmt::Display for RecordingReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.parts, if self.parts == 1 { "part" } else { "parts" })?;
        match &self.ended_early {
            Some(reason) => write!(f, "; ended early: {reason}"),
            None => Ok(()),
        }
    }
}
