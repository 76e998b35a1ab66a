//! Report on a recording, shared by its writer, the console and the end of the run.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use telemetry::recording::RecordingReport;

/// Report that the writer of a session keeps up to date.
#[derive(Clone, Debug, Default)]
pub(super) struct RecordingState(Arc<Mutex<RecordingReport>>);

impl RecordingState {
    /// Returns the newest report.
    pub(super) fn get(&self) -> RecordingReport {
        self.lock().clone()
    }

    /// Replaces the report, which readers then see.
    pub(super) fn set(&self, report: RecordingReport) {
        *self.lock() = report;
    }

    fn lock(&self) -> MutexGuard<'_, RecordingReport> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
