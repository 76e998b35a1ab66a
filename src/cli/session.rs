//! The folder of a session: `bus.log` and `summary.json`.

use std::fs;
use std::fs::File;
use std::io;
use std::io::BufWriter;
use std::path::Path;
use std::path::PathBuf;

use anyhow::Context;

use crate::telemetry::candump::LogWriter;
use crate::telemetry::session::SessionLog;
use crate::telemetry::summary::Summary;

/// A session that is being written.
#[derive(Debug)]
pub(super) struct Session {
    folder: PathBuf,
    pub(super) log: SessionLog<BufWriter<File>>,
    is_told: bool,
}

impl Session {
    /// Makes the folder and begins its log. Stamps are `epoch_micros` plus the bus's time.
    pub(super) fn create(
        folder: &Path,
        interfaces: &[String],
        epoch_micros: u64,
    ) -> anyhow::Result<Self> {
        let make = || -> io::Result<File> {
            fs::create_dir_all(folder)?;
            File::create(folder.join("bus.log"))
        };
        let file = make().with_context(|| format!("session {}", folder.display()))?;
        let writer = LogWriter::new(BufWriter::new(file), interfaces, epoch_micros);
        let folder = folder.to_path_buf();
        Ok(Self { folder, log: SessionLog::new(writer), is_told: false })
    }

    /// Why nothing is recorded any more, once.
    pub(super) fn news(&mut self) -> Option<String> {
        let error = self.log.failure().filter(|_| !self.is_told)?;
        self.is_told = true;
        Some(format!("session {}: the recording ends here: {error}", self.folder.display()))
    }

    /// Ends the log and writes the summary, which may find room where the log did not.
    pub(super) fn finish(self, summary: &Summary) -> anyhow::Result<()> {
        let Self { folder, log, .. } = self;
        let named = || format!("session {}", folder.display());
        let ended = log.finish().with_context(|| format!("{}: not complete", named()));
        let mut text = serde_json::to_string_pretty(summary)?;
        text.push('\n');
        let written = fs::write(folder.join("summary.json"), text).with_context(named);
        ended.and(written)
    }
}
