//! The folder of a session, readable by its owner only: `session.json` and the copied files, `bus.log`, `inputs.bin`,
//! `summary.json` and fault records. A session never overwrites another.

use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::exit::{Failure, Kind, OrFail};
use crate::fault_records;
use crate::inputs_file::{self, InputsFile};
use crate::log_file::LogFile;
use crate::provenance::Provenance;
use crate::record_sink::RecordSink;
use crate::results::{self, Access, Force};
use crate::sources::{self, Sources};
use bus::log_writer::LogWriter;
use canopen::frame::Telegram;
use inputs::Input;
use inputs::intermediates::Digest;
use node::record::Record;
use telemetry::origin::Origin;
use telemetry::session::{Brief, SessionLog};
use telemetry::summary::Summary;
use units::time::Instant;

/// Files of a session, and the folder of its fault records.
const LOG: &str = "bus.log";
const SUMMARY: &str = "summary.json";
pub(super) const FAULTS: &str = "faults";

/// A session being written.
#[derive(Debug)]
pub(super) struct Session {
    folder: PathBuf,
    log: SessionLog<BufWriter<LogFile>>,
    inputs: Option<InputsFile>,
    /// The failure of a file was reported.
    is_reported: bool,
}

impl Session {
    /// Creates the folder and its log.
    ///
    /// # Errors
    /// When the folder cannot be created, or has a log already.
    pub(super) fn create(
        folder: &Path,
        provenance: &Provenance,
        sources: &Sources,
    ) -> anyhow::Result<Self> {
        let create = || -> io::Result<(File, InputsFile)> {
            results::private_folder(folder)?;
            let log = results::private_file(&folder.join(LOG))?;
            let inputs = InputsFile::onto(results::private_file(&folder.join(inputs_file::NAME))?)?;
            sources.write(folder, provenance)?;
            Ok((log, inputs))
        };
        let created = create().with_context(|| format!("session {}", folder.display()));
        let (log, inputs) = created?;
        Ok(Self { inputs: Some(inputs), ..Self::onto(log, folder, provenance) })
    }

    /// Returns a session that has only a log, which is written to `file`.
    pub(super) fn onto(file: File, folder: &Path, provenance: &Provenance) -> Self {
        let Provenance { interfaces, origin, .. } = provenance;
        let file = BufWriter::new(LogFile::onto(file));
        let writer = LogWriter::new(file, interfaces, origin.as_micros());
        let folder = folder.to_path_buf();
        Self { folder, log: SessionLog::new(writer), inputs: None, is_reported: false }
    }

    /// Returns its folder.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Closes the log and writes the summary, even if the log has failed.
    pub(super) fn finish(self, summary: &Summary) -> anyhow::Result<()> {
        let Self { folder, log, inputs, is_reported } = self;
        let named = || format!("session {}", folder.display());
        let inputs = inputs.map_or(Ok(()), InputsFile::finish);
        let ended = log.finish().and(inputs).map_err(|error| match is_reported {
            true => anyhow::anyhow!("{}: incomplete", named()),
            false => anyhow::anyhow!("{}: incomplete: {error}", named()),
        });
        let mut text = serde_json::to_string_pretty(summary)?;
        text.push('\n');
        let written = results::replace(&folder.join(SUMMARY), text.as_bytes(), Access::Owner);
        ended.and(written.with_context(named))
    }
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
/// An earlier session exists and `--force` is not given, or cannot be removed.
pub fn make_room(folder: &Path, force: Force) -> Result<(), Failure> {
    let names =
        [LOG, inputs_file::NAME, SUMMARY, sources::DESCRIPTION, sources::FILES, FAULTS].into_iter();
    names.map(|name| folder.join(name)).try_for_each(|path| results::ensure_free(&path, force))?;
    let gone = |file| match fs::remove_file(folder.join(file)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        Ok(()) | Err(_) => Ok(()),
    };
    let cleared =
        [LOG, inputs_file::NAME, SUMMARY, sources::DESCRIPTION].into_iter().try_for_each(gone);
    let cleared = cleared.and_then(|()| sources::clear(folder));
    let cleared = cleared.and_then(|()| fault_records::clear(&folder.join(FAULTS)));
    cleared.with_context(|| format!("session {}", folder.display())).or_fail(Kind::File)
}

impl RecordSink for Session {
    fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.log.frame(at, telegram);
    }

    fn on_cycle(&mut self, record: &Record) {
        self.log.cycle(&Brief::from(record));
        let digest = Digest::of(&record.output);
        self.on_input(&Input::Intermediates(record.cycle, digest));
    }

    fn on_input(&mut self, input: &Input) {
        self.inputs.iter_mut().for_each(|inputs| inputs.write(input));
    }

    /// Returns the write error that has ended a file, once.
    fn next_message(&mut self) -> Option<String> {
        let of_inputs = self.inputs.as_ref().and_then(InputsFile::failure);
        let error = self.log.failure().or(of_inputs).filter(|_| !self.is_reported)?;
        self.is_reported = true;
        Some(format!("session {}: the recording has stopped: {error}", self.folder.display()))
    }
}

#[cfg(test)]
mod tests {
    use std::io::pipe;
    use std::os::fd::OwnedFd;
    use std::os::unix::fs::PermissionsExt;

    use serde_json::Value;

    use super::*;
    use crate::scratch::{no_sources, path as scratch};
    use canopen::frame::{Channel, Frame};

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
        let mut session = Session::create(&folder, &provenance(), &no_sources()).unwrap();
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
        let mut first = Session::create(&folder, &provenance(), &no_sources()).unwrap();
        first.on_frame(Instant::ZERO, &sync());
        first.finish(&Summary::default()).unwrap();
        let log = fs::read(folder.join(LOG)).unwrap();
        let error = Session::create(&folder, &provenance(), &no_sources()).unwrap_err();
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
        let mut session = Session::onto(File::from(OwnedFd::from(disk)), &folder, &provenance());
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
