//! File of the frames sent by a replayed node.

use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::whole_file::WholeFile;
use bus::log_writer::LogWriter;
use canopen::frame::Telegram;
use run::exit::{Failure, Kind, OrFail};
use run::results::Force;
use telemetry::manifest::Manifest;
use units::time::Instant;

/// File of the node's frames, which gets its name when it is complete.
pub(super) struct FrameFile {
    path: PathBuf,
    log: LogWriter<WholeFile>,
}

impl FrameFile {
    pub(super) fn create(path: &Path, manifest: &Manifest) -> Result<Self, Failure> {
        // Without --force an existing file, which may be evidence, is not replaced.
        if path.symlink_metadata().is_ok() {
            return Err(Failure::new(Kind::File, format!("{}: exists", path.display())));
        }
        let file = WholeFile::create(Some(path), Force { force: false })?;
        let log = LogWriter::new(file, &manifest.interfaces, manifest.origin_us);
        Ok(Self { path: path.to_path_buf(), log })
    }

    pub(super) fn write(&mut self, sent: &[(Instant, Telegram)]) -> Result<(), Failure> {
        let written = sent.iter().try_for_each(|(at, telegram)| self.log.frame(*at, telegram));
        written.with_context(|| self.path.display().to_string()).or_fail(Kind::File)
    }

    pub(super) fn finish(self) -> Result<(), Failure> {
        self.log.into_inner().finish()
    }
}
