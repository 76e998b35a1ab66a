//! Fault record, and the session that it is a part of.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Deserialize;
use thiserror::Error;

use crate::session::{self, SessionError};
use telemetry::trip::{POST_TRIGGER, PRE_TRIGGER};
use units::time::Instant;

/// Description of a fault record.
const DOCUMENT: &str = "fault.json";

/// Description of a session, and the folder of its fault records.
const SESSION: &str = "session.json";
const FAULTS: &str = "faults";

/// Fault record of a recorded session.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultRecord {
    /// Folder of its session.
    pub session: PathBuf,
    /// Number of the cycle that tripped, as in `bus.log`.
    pub cycle: u64,
    /// Its cause, in words.
    pub cause: String,
    /// Time of the SYNC of that cycle.
    pub at: Instant,
    /// Time from the first frame of the record to the trip, in s: 2 s, or less soon after the start.
    pub seconds: f64,
    /// Mode before, and latched mode.
    pub modes: [String; 2],
}

/// Keys of the description that a replay needs.
#[derive(Deserialize)]
struct Document {
    cause: String,
    cycle: u64,
    seconds: f64,
    seconds_before: f64,
    mode_before: String,
    mode: String,
    /// Folder of the session, relative to that of the record.
    session: Option<PathBuf>,
    /// Cycle in the session, where it is another than `cycle`.
    session_cycle: Option<u64>,
}

/// Reasons why a fault record cannot be replayed.
#[derive(Debug, Error)]
pub enum FaultRecordError {
    /// Description that is unreadable or invalid.
    #[error(transparent)]
    Description(#[from] SessionError),
    /// No session was recorded, or it is elsewhere now.
    #[error(
        "{record}: the session of this fault record is not there, so it cannot be replayed; `frhc report {record}` shows it"
    )]
    WithoutSession { record: PathBuf },
}

impl FaultRecord {
    /// Reads a fault record; `None` where the folder has none.
    ///
    /// # Errors
    /// Returns an error if its description is invalid, or its session is absent.
    pub fn open(folder: &Path) -> Result<Option<Self>, FaultRecordError> {
        let file = folder.join(DOCUMENT);
        if file.symlink_metadata().is_err() {
            return Ok(None);
        }
        let invalid = |error| SessionError::Invalid { file: file.clone(), error };
        let document: Document = serde_json::from_slice(&session::read(&file)?).map_err(invalid)?;
        let at = Duration::try_from_secs_f64(document.seconds);
        let at = at.map_err(|error| invalid(serde::de::Error::custom(error)))?;
        let Some(session) = session_of(folder, document.session.as_deref()) else {
            return Err(FaultRecordError::WithoutSession { record: folder.to_path_buf() });
        };
        Ok(Some(Self {
            session,
            cycle: document.session_cycle.unwrap_or(document.cycle),
            cause: document.cause,
            // The document has seconds; times on the bus are whole microseconds.
            at: Instant::ZERO + at.saturating_add(Duration::from_nanos(500)),
            seconds: document.seconds_before,
            modes: [document.mode_before, document.mode],
        }))
    }

    /// Returns the time of the first frames in a record of full length.
    pub fn begin(&self) -> Instant {
        self.at - PRE_TRIGGER
    }

    /// Returns the time of the last frames in a record of full length.
    pub fn end(&self) -> Instant {
        self.at + POST_TRIGGER
    }
}

/// Returns the folder of the session that a record names, or lies in.
fn session_of(record: &Path, named: Option<&Path>) -> Option<PathBuf> {
    // The record's own name may be a dot.
    let record = record.canonicalize().ok()?;
    let folder = match named {
        Some(named) => record.join(named),
        None => {
            let faults = record.parent().filter(|folder| folder.ends_with(FAULTS))?;
            faults.parent()?.to_path_buf()
        }
    };
    let folder = folder.canonicalize().ok()?;
    folder.join(SESSION).is_file().then_some(folder)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use tempfile::tempdir;

    use super::*;

    const FAULT: &str = r#"{ "cause": "late", "cycle": 4213, "seconds": 3.702001, "seconds_before": 2.0, "mode_before": "engaged", "mode": "zero torque" }"#;

    #[test]
    fn record_is_part_of_the_session_that_it_lies_in_or_names() {
        let folder = tempdir().unwrap();
        let session = folder.path().canonicalize().unwrap();
        let record = session.join("faults/001-4213-late");
        fs::create_dir_all(&record).unwrap();
        assert_eq!(FaultRecord::open(&record).unwrap(), None);
        fs::write(record.join(DOCUMENT), FAULT).unwrap();
        let error = FaultRecord::open(&record).unwrap_err().to_string();
        assert!(error.contains("frhc report"), "{error}");

        fs::write(session.join(SESSION), "{}").unwrap();
        let found = FaultRecord::open(&record).unwrap().unwrap();
        assert_eq!((&found.session, found.cycle), (&session, 4_213));
        assert_eq!(found.at, Instant::from_micros(3_702_001));

        let moved = session.join("moved");
        fs::create_dir(&moved).unwrap();
        let named = FAULT.replacen('{', r#"{ "session": "..", "session_cycle": 7,"#, 1);
        fs::write(moved.join(DOCUMENT), named).unwrap();
        let found = FaultRecord::open(&moved).unwrap().unwrap();
        assert_eq!((found.session, found.cycle), (session, 7));
        for invalid in ["{", &FAULT.replace("3.7", "-3.7")] {
            fs::write(moved.join(DOCUMENT), invalid).unwrap();
            let error = FaultRecord::open(&moved).unwrap_err().to_string();
            assert!(error.contains("fault.json: "), "{error}");
        }
    }
}
