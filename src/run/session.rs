//! Folder of a session: `session.json` and the copied files, the parts of `bus.log` and `inputs.bin`, `summary.json`,
//! `timing.json` and fault records. It is readable by its owner only, and never overwrites another session.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;

use crate::exit::{Failure, Kind, OrFail};
use crate::fault_records;
use crate::limits::Limits;
use crate::provenance::Provenance;
use crate::record_sink::RecordSink;
use crate::recording_state::RecordingState;
use crate::results::{self, Access, Force};
use crate::session_files::SessionFiles;
use crate::sources::{self, Sources};
use canopen::frame::Telegram;
use inputs::Input;
use node::record::Record;
use telemetry::origin::Origin;
use telemetry::parts::{Part, Parts};
use telemetry::recording::RecordingReport;
use telemetry::recording_lock::RecordingLock;
use telemetry::summary::Summary;
use telemetry::timing::Timing;
use units::time::Instant;

/// Files of a session, and the folder of its fault records.
pub(super) const SUMMARY: &str = "summary.json";
const TIMING: &str = "timing.json";
pub(super) const FAULTS: &str = "faults";

/// Session being written.
#[derive(Debug)]
pub(super) struct Session {
    folder: PathBuf,
    files: SessionFiles,
    /// Set once an early end of the recording was reported.
    is_reported: bool,
    state: RecordingState,
    /// Shows other processes that this one records.
    lock: Option<RecordingLock>,
}

impl Session {
    /// Creates the folder and its first part.
    ///
    /// # Errors
    /// When the folder cannot be created, or has a log already.
    pub(super) fn create(
        folder: &Path,
        provenance: &Provenance,
        sources: &Sources,
        limits: Limits,
    ) -> anyhow::Result<Self> {
        let create = || -> io::Result<SessionFiles> {
            results::private_folder(folder)?;
            let files = SessionFiles::create(folder, provenance, limits)?;
            sources.write(folder, provenance)?;
            Ok(files)
        };
        let files = create().with_context(|| format!("session {}", folder.display()))?;
        let lock = RecordingLock::take(&folder.join(sources::DESCRIPTION));
        Ok(Self { lock, ..Self::new(files, folder) })
    }

    /// Returns a session of these files.
    pub(super) fn new(files: SessionFiles, folder: &Path) -> Self {
        let folder = folder.to_path_buf();
        let state = RecordingState::default();
        let session = Self { folder, files, is_reported: false, state, lock: None };
        session.state.set(session.report());
        session
    }

    /// Returns the folder that has the parts and documents.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the report on this recording, which other threads may read.
    pub(super) fn state(&self) -> RecordingState {
        self.state.clone()
    }

    fn report(&self) -> RecordingReport {
        let ended_early = self.files.ended_early().map(|end| match end {
            Ok(limit) => limit,
            Err(error) => error.to_string(),
        });
        RecordingReport { parts: self.files.parts(), ended_early }
    }

    /// Closes the files and writes the summary, even if one has failed.
    pub(super) fn finish(self, summary: &Summary) -> anyhow::Result<()> {
        let mut report = self.report();
        let Self { folder, files, is_reported, state, lock: _lock } = self;
        let named = || format!("session {}", folder.display());
        let ended = files.finish().map_err(|error| {
            report.ended_early.get_or_insert_with(|| error.to_string());
            match is_reported {
                true => anyhow::anyhow!("{}: incomplete", named()),
                false => anyhow::anyhow!("{}: incomplete: {error}", named()),
            }
        });
        state.set(report.clone());
        let histograms = summary.histograms.as_ref().map(Timing::histograms);
        let timing = histograms.map_or(Ok(()), |of| write(&folder.join(TIMING), &of));
        let mut summary = summary.clone();
        summary.recording = Some(report);
        let written = timing.and(write(&folder.join(SUMMARY), &summary));
        ended.and(written.with_context(named))
    }
}

/// Writes a document as JSON, in one step.
fn write(path: &Path, document: &impl Serialize) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(document)?;
    text.push('\n');
    Ok(results::replace(path, text.as_bytes(), Access::Owner)?)
}

/// Creates a folder for a new session in `parent`: `NNN-UTC`, counted from 001.
pub(super) fn create_numbered(parent: &Path, origin: Origin) -> anyhow::Result<PathBuf> {
    let folder =
        results::create_numbered(parent, |number| format!("{number:03}-{}", origin.compact()));
    folder.with_context(|| format!("--record {}", parent.display()))
}

/// Ensures that `folder` has no session. Removes an earlier one if forced.
///
/// # Errors
/// When an earlier session exists and `--force` is not given, or it cannot be removed.
pub fn make_room(folder: &Path, force: Force) -> Result<(), Failure> {
    let parts = match Parts::find(folder, None) {
        Ok(parts) => parts.files().iter().map(Part::name).collect(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => {
            return Err(error).with_context(|| folder.display().to_string()).or_fail(Kind::File);
        }
    };
    let documents = [SUMMARY, TIMING, sources::DESCRIPTION];
    let files = || parts.iter().map(String::as_str).chain(documents);
    let mut all = files().chain([sources::FILES, FAULTS]).map(|name| folder.join(name));
    all.try_for_each(|path| results::ensure_free(&path, force))?;
    let gone = |file| match fs::remove_file(folder.join(file)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        Ok(()) | Err(_) => Ok(()),
    };
    let cleared = files().try_for_each(gone);
    let cleared = cleared.and_then(|()| sources::clear(folder));
    let cleared = cleared.and_then(|()| fault_records::clear(&folder.join(FAULTS)));
    cleared.with_context(|| format!("session {}", folder.display())).or_fail(Kind::File)
}

impl RecordSink for Session {
    fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.files.frame(at, telegram);
    }

    fn on_cycle(&mut self, record: &Record) {
        let parts = self.files.parts();
        self.files.cycle(record);
        if self.files.parts() != parts {
            self.state.set(self.report());
        }
    }

    fn on_input(&mut self, input: &Input) {
        self.files.input(input);
    }

    /// Returns the reason of an early end, once.
    fn next_message(&mut self) -> Option<String> {
        if self.is_reported {
            return None;
        }
        let end = self.files.ended_early()?;
        let folder = self.folder.display();
        let message = match end {
            Ok(limit) => {
                format!("session {folder}: the recording has ended, and the run goes on: {limit}")
            }
            Err(error) => format!("session {folder}: the recording has stopped: {error}"),
        };
        self.is_reported = true;
        self.state.set(self.report());
        Some(message)
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::pipe;
    use std::os::fd::OwnedFd;
    use std::os::unix::fs::PermissionsExt;

    use serde_json::Value;

    use super::*;
    use crate::scratch::{no_sources, path as scratch};
    use canopen::frame::{Channel, Frame};

    const LOG: &str = "bus.log";

    const ORIGIN: Origin = Origin::from_micros(1_795_331_563_123_456);

    fn provenance() -> Provenance {
        let interfaces = vec!["can0".to_owned()];
        Provenance { interfaces, origin: ORIGIN, ..Provenance::default() }
    }

    fn sync() -> Telegram {
        Telegram { channel: Channel(0), frame: Frame::new(0x80, []) }
    }

    fn mode_of(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn session_has_log_and_summary_for_its_owner_only() {
        let folder = scratch("session");
        let mut session =
            Session::create(&folder, &provenance(), &no_sources(), Limits::NONE).unwrap();
        session.on_frame(Instant::from_micros(7), &sync());
        assert_eq!(session.next_message(), None);
        let mut summary = Summary::default();
        summary.cycles = 42;
        session.finish(&summary).unwrap();
        let (log, summary) = (folder.join(LOG), folder.join(SUMMARY));
        // The timestamp is wall-clock time: origin plus time on the bus.
        assert_eq!(fs::read_to_string(&log).unwrap(), "(1795331563.123463) can0 080#\n");
        let document: Value = serde_json::from_slice(&fs::read(&summary).unwrap()).unwrap();
        assert_eq!(document["cycles"], 42);
        assert_eq!((mode_of(&folder), mode_of(&log), mode_of(&summary)), (0o700, 0o600, 0o600));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn session_never_overwrites_the_log_of_an_earlier_one() {
        let folder = scratch("session-twice");
        let mut first =
            Session::create(&folder, &provenance(), &no_sources(), Limits::NONE).unwrap();
        first.on_frame(Instant::ZERO, &sync());
        first.finish(&Summary::default()).unwrap();
        let log = fs::read(folder.join(LOG)).unwrap();
        let error =
            Session::create(&folder, &provenance(), &no_sources(), Limits::NONE).unwrap_err();
        assert!(format!("{error:#}").contains("exists"), "{error:#}");
        assert_eq!(fs::read(folder.join(LOG)).unwrap(), log);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn log_that_ends_early_is_reported_once_and_leaves_a_summary() {
        let folder = scratch("session-full");
        fs::create_dir(&folder).unwrap();
        let (unread, disk) = pipe().unwrap();
        drop(unread);
        let disk = File::from(OwnedFd::from(disk));
        let mut session = Session::new(SessionFiles::onto(disk, &folder, &provenance()), &folder);
        // More than the buffer holds.
        (0..10_000).for_each(|at| session.on_frame(Instant::from_micros(at), &sync()));
        assert!(session.next_message().unwrap().contains("the recording has stopped: "));
        assert_eq!(session.next_message(), None);
        let error = session.finish(&Summary::default()).unwrap_err().to_string();
        assert!(error.ends_with("session-full: incomplete"), "{error}");
        assert!(folder.join(SUMMARY).exists());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn recorded_sessions_are_numbered_and_dated() {
        let parent = scratch("sessions");
        let names = ["001-20261122T071243Z", "002-20261122T071243Z"];
        for name in names {
            assert_eq!(create_numbered(&parent, ORIGIN).unwrap(), parent.join(name));
        }
        fs::write(parent.join("file"), "").unwrap();
        let error = create_numbered(&parent.join("file"), ORIGIN).unwrap_err().to_string();
        assert!(error.starts_with("--record "), "{error}");
        fs::remove_dir_all(&parent).unwrap();
    }

    #[test]
    fn earlier_session_is_refused_or_removed_if_forced() {
        let folder = scratch("session-room");
        let record = folder.join(FAULTS).join("001-7-late");
        fs::create_dir_all(&record).unwrap();
        make_room(&scratch("session-none"), Force { force: false }).unwrap();
        for file in [folder.join("notes"), record.join("bus.log")] {
            fs::write(file, "").unwrap();
        }
        for file in [LOG, SUMMARY] {
            fs::write(folder.join(file), "earlier").unwrap();
            let refused = make_room(&folder, Force { force: false }).unwrap_err();
            assert!(refused.to_string().contains("--force"), "{refused}");
        }
        assert_eq!(fs::read_to_string(folder.join(LOG)).unwrap(), "earlier");
        make_room(&folder, Force { force: true }).unwrap();
        let left: Vec<_> =
            fs::read_dir(&folder).unwrap().map(|it| it.unwrap().file_name()).collect();
        assert_eq!(left, ["notes"]);
        fs::remove_dir_all(&folder).unwrap();
    }
}
