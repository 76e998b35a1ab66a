//! Trip of a fault record, compared with the replay of its session.

use std::fmt;

use serde::ser::{Serialize, SerializeStruct, Serializer};

use ::replay::FaultRecord;
use node::record::Record;
use run::exit::{Failure, Kind};

/// Comparison of the trip in a fault record with the replayed one.
#[derive(Debug)]
pub(super) struct TripComparison {
    recorded: FaultRecord,
    /// Cause in the replayed cycle of the trip, in words; `None` before that cycle.
    replayed: Option<String>,
}

impl TripComparison {
    /// Creates the comparison for a record.
    pub(super) const fn new(recorded: FaultRecord) -> Self {
        Self { recorded, replayed: None }
    }

    /// Takes a replayed cycle.
    pub(super) fn on_cycle(&mut self, record: &Record) {
        if record.cycle == self.recorded.cycle {
            let cause = record.cause.map(|cause| cause.to_string());
            self.replayed = Some(cause.unwrap_or_else(|| "no cause".to_owned()));
        }
    }

    /// Checks that the replay tripped in the same cycle by the same cause.
    ///
    /// # Errors
    /// Returns an error if the cause differs, or the replay ended before the trip.
    pub(super) fn ensure_found(&self) -> Result<(), Failure> {
        let FaultRecord { cycle, cause, .. } = &self.recorded;
        let reason = match &self.replayed {
            Some(replayed) if replayed == cause => return Ok(()),
            Some(replayed) => format!(
                "the record has \"{cause}\" in cycle {cycle}, the replay has \"{replayed}\""
            ),
            None => format!("the record has \"{cause}\" in cycle {cycle}, which was not replayed"),
        };
        Err(Failure::new(Kind::Negative, reason))
    }
}

impl fmt::Display for TripComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FaultRecord { cycle, cause, seconds, modes: [before, after], .. } = &self.recorded;
        write!(
            f,
            "trip      cycle {cycle}, {seconds:.3} s after the begin of the record: {cause}; from {before} to {after}"
        )
    }
}

impl Serialize for TripComparison {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let FaultRecord { cycle, cause, seconds, .. } = &self.recorded;
        let mut object = serializer.serialize_struct("TripComparison", 4)?;
        object.serialize_field("cycle", cycle)?;
        object.serialize_field("cause", cause)?;
        object.serialize_field("replayed_cause", &self.replayed)?;
        object.serialize_field("seconds_before", seconds)?;
        object.end()
    }
}
