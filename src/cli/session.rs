//! The folder of a session: `bus.log`, `summary.json` and fault records, for their owner alone. A session is never
//! written over another.

use std::fs;
use std::fs::File;
use std::io;
use std::io::BufWriter;
use std::path::Path;
use std::path::PathBuf;

use anyhow::Context;

use crate::canopen::frame::Telegram;
use crate::cli::archive::Kept;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::fault_records;
use crate::cli::log_file::LogFile;
use crate::cli::provenance::Provenance;
use crate::cli::results;
use crate::cli::results::Access;
use crate::cli::results::Force;
use crate::telemetry::candump::LogWriter;
use crate::telemetry::origin::Origin;
use crate::telemetry::record::Record;
use crate::telemetry::session::Brief;
use crate::telemetry::session::SessionLog;
use crate::telemetry::summary::Summary;
use crate::time::Instant;

/// The files of a session, and the folder of its fault records.
const LOG: &str = "bus.log";
const SUMMARY: &str = "summary.json";
pub(super) const FAULTS: &str = "faults";

/// A session that is being written.
#[derive(Debug)]
pub(super) struct Session {
    folder: PathBuf,
    log: SessionLog<BufWriter<LogFile>>,
    is_told: bool,
}

impl Session {
    /// Makes the folder and begins its log.
    ///
    /// # Errors
    /// When there is no such folder, or it has a log already.
    pub(super) fn create(folder: &Path, provenance: &Provenance) -> anyhow::Result<Self> {
        let make = || -> io::Result<File> {
            results::private_folder(folder)?;
            results::private_file(&folder.join(LOG))
        };
        let file = make().with_context(|| format!("session {}", folder.display()))?;
        Ok(Self::onto(file, folder, provenance))
    }

    /// A session whose log goes to `file`.
    pub(super) fn onto(file: File, folder: &Path, provenance: &Provenance) -> Self {
        let Provenance { interfaces, origin, .. } = provenance;
        let file = BufWriter::new(LogFile::onto(file));
        let writer = LogWriter::new(file, interfaces, origin.as_micros());
        let folder = folder.to_path_buf();
        Self { folder, log: SessionLog::new(writer), is_told: false }
    }

    /// Ends the log and writes the summary, which may find room where the log did not.
    pub(super) fn finish(self, summary: &Summary) -> anyhow::Result<()> {
        let Self { folder, log, is_told } = self;
        let named = || format!("session {}", folder.display());
        let ended = log.finish().map_err(|error| match is_told {
            true => anyhow::anyhow!("{}: not complete", named()),
            false => anyhow::anyhow!("{}: not complete: {error}", named()),
        });
        let mut text = serde_json::to_string_pretty(summary)?;
        text.push('\n');
        let written = results::replace(&folder.join(SUMMARY), text.as_bytes(), Access::Owner);
        ended.and(written.with_context(named))
    }
}

/// Makes a folder for a session of its own in `parent`: `NNN-UTC`, counted from 001.
pub(super) fn numbered(parent: &Path, origin: Origin) -> anyhow::Result<PathBuf> {
    let folder = results::numbered(parent, |number| format!("{number:03}-{}", origin.compact()));
    folder.with_context(|| format!("--record {}", parent.display()))
}

/// Makes sure that `folder` has no session. An earlier one is refused or, if forced, removed.
pub(super) fn make_room(folder: &Path, force: Force) -> Result<(), Failure> {
    let names = [LOG, SUMMARY, FAULTS].into_iter();
    names.map(|name| folder.join(name)).try_for_each(|path| results::refuse(&path, force))?;
    let gone = |file| match fs::remove_file(folder.join(file)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        Ok(()) | Err(_) => Ok(()),
    };
    let cleared = [LOG, SUMMARY].into_iter().try_for_each(gone);
    let cleared = cleared.and_then(|()| fault_records::clear(&folder.join(FAULTS)));
    cleared.with_context(|| format!("session {}", folder.display())).or_fail(Kind::File)
}

impl Kept for Session {
    fn frame(&mut self, at: Instant, telegram: &Telegram) {
        self.log.frame(at, telegram);
    }

    fn cycle(&mut self, record: &Record) {
        self.log.cycle(&Brief::from(record));
    }

    /// Why nothing is recorded any more, once.
    fn news(&mut self) -> Option<String> {
        let error = self.log.failure().filter(|_| !self.is_told)?;
        self.is_told = true;
        Some(format!("session {}: the recording ends here: {error}", self.folder.display()))
    }
}
