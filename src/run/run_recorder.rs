//! Recordings of one run: the session, with `--record` or `--out`, and a fault record for each trip.

use std::path::{Path, PathBuf};

use crate::fault_records::{self, FaultRecorder};
use crate::limits::Limits;
use crate::provenance::Provenance;
use crate::record_sink::RecordSink;
use crate::recording_state::RecordingState;
use crate::session::{self, Session};
use crate::sources::Sources;
use canopen::frame::Telegram;
use inputs::Input;
use node::record::Record;
use telemetry::summary::Summary;
use units::time::Instant;

/// Recorder of a session, of fault records, of both or neither.
#[derive(Debug, Default)]
pub struct RunRecorder {
    pub(super) session: Option<Session>,
    pub(super) faults: Option<FaultRecorder>,
    pub(super) message: Option<String>,
}

impl RunRecorder {
    /// Records a session in `folder`, within these limits, with its fault records in `folder/faults`.
    ///
    /// # Errors
    /// When the session's files cannot be created.
    pub fn with_session(
        folder: &Path,
        provenance: &Provenance,
        sources: &Sources,
        limits: Limits,
    ) -> anyhow::Result<Self> {
        let session = Session::create(folder, provenance, sources, limits)?;
        let provenance = &provenance.in_session(folder);
        let faults = Some(folder.join(session::FAULTS));
        Ok(Self { session: Some(session), ..Self::with_fault_records_in(faults, provenance) })
    }

    /// Records faults only, in the default folder.
    pub(super) fn fault_records_only(provenance: &Provenance) -> Self {
        Self::with_fault_records_in(fault_records::default_folder(), provenance)
    }

    fn with_fault_records_in(folder: Option<PathBuf>, provenance: &Provenance) -> Self {
        let Some(folder) = folder else {
            let message = "no fault records: neither STATE_DIRECTORY nor HOME is set".to_owned();
            return Self { message: Some(message), ..Self::default() };
        };
        match FaultRecorder::open(&folder, provenance) {
            Ok(faults) => Self { faults: Some(faults), ..Self::default() },
            Err(error) => {
                let message = format!("no fault records in {}: {error}", folder.display());
                Self { message: Some(message), ..Self::default() }
            }
        }
    }

    /// Records a frame that was sent or received `at` this time.
    pub fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        if let Some(faults) = &mut self.faults {
            faults.on_frame(at, telegram);
        }
        if let Some(session) = &mut self.session {
            session.on_frame(at, telegram);
        }
    }

    /// Records the end of a cycle, and detects a trip.
    pub fn on_cycle(&mut self, record: &Record) {
        if let Some(faults) = &mut self.faults {
            faults.on_cycle(record);
        }
        if let Some(session) = &mut self.session {
            session.on_cycle(record);
        }
    }

    /// Returns whether a session is recorded.
    pub const fn has_session(&self) -> bool {
        self.session.is_some()
    }

    /// Returns the report on the session, if one is recorded.
    pub(super) fn recording(&self) -> Option<RecordingState> {
        self.session.as_ref().map(Session::state)
    }

    /// Records an input of the node.
    pub fn on_input(&mut self, input: &Input) {
        if let Some(session) = &mut self.session {
            session.on_input(input);
        }
    }

    /// Returns the next message to log: the path of a fault record, or the reason of a failure.
    pub fn next_message(&mut self) -> Option<String> {
        let message = self.message.take();
        let message = message.or_else(|| self.session.as_mut().and_then(Session::next_message));
        message.or_else(|| self.faults.as_mut().and_then(FaultRecorder::next_message))
    }

    /// Closes the recordings; returns a line that names the fault records of this run.
    ///
    /// # Errors
    /// When the session is incomplete on disk. The fault records are complete even then.
    pub fn finish(self, summary: &Summary) -> (Option<String>, anyhow::Result<()>) {
        let records = self.faults.and_then(FaultRecorder::finish);
        (records, self.session.map_or(Ok(()), |session| session.finish(summary)))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::scratch::any_record;
    use crate::scratch::{no_sources, path as scratch};
    use canopen::frame::{Channel, Frame};
    use node::cause::Cause;
    use node::record::Mode;
    use units::numbering::Joint;

    fn provenance() -> Provenance {
        Provenance { interfaces: vec!["can0".to_owned()], ..Provenance::default() }
    }

    /// Records two SYNCs and cycles, the second with a trip.
    fn record_trip(recorder: &mut RunRecorder) {
        let record = any_record();
        let cause = Some(Cause::SamplesMissing { joint: Joint::of::<3>(), cycles: 3 });
        let engaged = Record { mode: Mode::Engaged, cause: None, ..record };
        let stopped = Record { mode: Mode::ZeroTorque, cause, ..record };
        for (cycle, record) in [(1, engaged), (2, stopped)] {
            let at = Instant::from_micros(1_000 * cycle);
            let frame = Frame::new(0x80, []);
            recorder.on_frame(at, &Telegram { channel: Channel(0), frame });
            recorder.on_cycle(&Record { cycle, at, ..record });
        }
    }

    #[test]
    fn session_holds_the_log_the_summary_and_its_fault_records() {
        let folder = scratch("recorder");
        let mut recorder =
            RunRecorder::with_session(&folder, &provenance(), &no_sources(), Limits::NONE).unwrap();
        record_trip(&mut recorder);
        let fault = folder.join("faults/001-2-samples-missing");
        assert_eq!(recorder.next_message(), Some(format!("fault record: {}", fault.display())));
        assert_eq!(recorder.next_message(), None);
        let (records, finished) = recorder.finish(&Summary::default());
        finished.unwrap();
        assert!(records.unwrap().ends_with("001-2-samples-missing"));
        for log in [folder.join("bus.log"), fault.join("bus.log")] {
            let log = fs::read_to_string(log).unwrap();
            let lines = |text: &str| log.lines().filter(|line| line.contains(text)).count();
            assert_eq!((lines(" can0 "), lines(" node0 ")), (2, 2), "{log}");
        }
        assert!(folder.join("summary.json").exists());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn run_without_trip_leaves_no_fault_records() {
        let folder = scratch("recorder-quiet");
        let recorder = RunRecorder::with_fault_records_in(Some(folder.clone()), &provenance());
        let (records, finished) = recorder.finish(&Summary::default());
        finished.unwrap();
        assert_eq!((records, folder.exists()), (None, false));
    }

    #[test]
    fn missing_folder_for_fault_records_is_reported_once() {
        let file = scratch("recorder-file");
        fs::write(&file, "").unwrap();
        for (folder, why) in
            [(None, "neither STATE_DIRECTORY nor HOME"), (Some(&file), "recorder-file")]
        {
            let mut recorder = RunRecorder::with_fault_records_in(folder.cloned(), &provenance());
            record_trip(&mut recorder);
            let message = recorder.next_message().unwrap();
            assert!(message.starts_with("no fault records") && message.contains(why), "{message}");
            assert_eq!(recorder.next_message(), None);
            let (records, finished) = recorder.finish(&Summary::default());
            finished.unwrap();
            assert_eq!(records, None);
        }
        fs::remove_file(&file).unwrap();
    }

    #[test]
    fn session_in_an_occupied_folder_is_an_error() {
        let folder = scratch("recorder-twice");
        RunRecorder::with_session(&folder, &provenance(), &no_sources(), Limits::NONE).unwrap();
        assert!(
            RunRecorder::with_session(&folder, &provenance(), &no_sources(), Limits::NONE).is_err()
        );
        fs::remove_dir_all(&folder).unwrap();
    }
}
