//! Entries lost between the cycle and the disk.

use std::fmt;

use serde::Serialize;

/// Numbers of lost entries by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// Frames lost before the recorder, and absent from every log.
    pub frames: u64,
    /// Records of cycles lost before the recorder, and absent from log and summary.
    pub records: u64,
    /// Inputs of the node lost before the recorder. A replay ends at the first.
    pub inputs: u64,
    /// Network events lost before the recorder, and not logged.
    pub events: u64,
    /// Frames and cycles dropped because the disk of the session was too slow.
    pub of_session: u64,
    /// Frames and cycles dropped because the disk of the fault records was too slow.
    pub of_faults: u64,
}

impl Losses {
    /// Returns whether there are no losses.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Lists the kinds with losses, as `3616 frames, 12 records`.
impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds = [
            (self.frames, "frames"),
            (self.records, "records"),
            (self.inputs, "inputs"),
            (self.events, "events"),
            (self.of_session, "entries of the session"),
            (self.of_faults, "entries of fault records"),
        ];
        let lost = kinds.into_iter().filter(|(count, _)| *count > 0);
        for (place, (count, kind)) in lost.enumerate() {
            let comma = if place > 0 { ", " } else { "" };
            write!(f, "{comma}{count} {kind}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_name_only_kinds_of_which_something_is_lost() {
        assert_eq!(Losses::default().to_string(), "");
        assert!(Losses::default().is_empty());
        let losses = Losses { frames: 3, of_session: 7, ..Losses::default() };
        assert_eq!(losses.to_string(), "3 frames, 7 entries of the session");
        assert!(!losses.is_empty());
    }
}
