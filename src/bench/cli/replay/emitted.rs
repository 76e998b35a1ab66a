//! The frames that a replayed node sends, written to a file.

use std::io::{BufWriter, IntoInnerError};
use std::path::{Path, PathBuf};

use anyhow::Context;
use tempfile::NamedTempFile;

use bus::log_writer::LogWriter;
use canopen::frame::Telegram;
use run::exit::{Failure, Kind, OrFail};
use telemetry::manifest::Manifest;
use units::time::Instant;

/// File of the frames that the node sends. It has its name once it is complete.
pub(super) struct Emitted {
    path: PathBuf,
    log: LogWriter<BufWriter<NamedTempFile>>,
}

impl Emitted {
    pub(super) fn create(path: &Path, manifest: &Manifest) -> Result<Self, Failure> {
        if path.symlink_metadata().is_ok() {
            return Err(Failure::new(Kind::File, format!("{}: exists", path.display())));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let file = NamedTempFile::new_in(folder.unwrap_or(Path::new(".")));
        let file = file.with_context(|| path.display().to_string()).or_fail(Kind::File)?;
        let log = LogWriter::new(BufWriter::new(file), &manifest.interfaces, manifest.origin_us);
        Ok(Self { path: path.to_path_buf(), log })
    }

    pub(super) fn write(&mut self, sent: &[(Instant, Telegram)]) -> Result<(), Failure> {
        let written = sent.iter().try_for_each(|(at, telegram)| self.log.frame(*at, telegram));
        written.with_context(|| self.path.display().to_string()).or_fail(Kind::File)
    }

    pub(super) fn finish(self) -> Result<(), Failure> {
        let Self { path, log } = self;
        let file = log.into_inner().into_inner().map_err(IntoInnerError::into_error);
        let named = file.and_then(|file| Ok(file.persist_noclobber(&path)?));
        named.map(drop).with_context(|| path.display().to_string()).or_fail(Kind::File)
    }
}
