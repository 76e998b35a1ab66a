//! Output file of any size that gets its name when it is complete, with access for its owner only.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, IntoInnerError, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use tempfile::NamedTempFile;

use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Access, Force};

/// Size of the buffer, in bytes.
const BUFFER: usize = 1 << 17;

/// Output file. Dropped before [`finish`](Self::finish), it is removed.
#[derive(Debug)]
pub(super) struct WholeFile {
    /// `None` for stdout.
    path: Option<PathBuf>,
    force: Force,
    to: BufWriter<Target>,
}

#[derive(Debug)]
enum Target {
    /// Temporary file beside the path.
    Beside(NamedTempFile),
    /// Stdout, a device or a pipe.
    Stream(File),
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Beside(file) => file.write(bytes),
            Self::Stream(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Target {
    fn at(path: &Path) -> io::Result<Self> {
        if results::is_stream(path) {
            return OpenOptions::new().write(true).open(path).map(Self::Stream);
        }
        if path.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        results::beside(path, Access::Owner).map(Self::Beside)
    }

    /// Gives a temporary file its name, once its content is on the disk.
    fn named(self, path: &Path, force: Force) -> io::Result<()> {
        let Self::Beside(file) = self else { return Ok(()) };
        file.as_file().sync_all()?;
        let moved = if force.force { file.persist(path) } else { file.persist_noclobber(path) };
        moved.map_err(|error| error.error)?;
        results::sync_folder(path)
    }
}

impl WholeFile {
    /// Creates a file at a path, or on stdout for `None`.
    ///
    /// # Errors
    /// Returns an error if the file exists and `force` is not given, or its folder cannot be written.
    pub(super) fn create(path: Option<&Path>, force: Force) -> Result<Self, Failure> {
        let target = match path {
            None => print::data().and_then(File::try_clone).map(Target::Stream).context("stdout"),
            Some(path) => {
                results::ensure_free(path, force)?;
                Target::at(path).with_context(|| path.display().to_string())
            }
        };
        let to = BufWriter::with_capacity(BUFFER, target.or_fail(Kind::File)?);
        Ok(Self { path: path.map(Path::to_path_buf), force, to })
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// Returns an error if a write has failed, or the path exists by now.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let Self { path, force, to } = self;
        let to = to.into_inner().map_err(IntoInnerError::into_error);
        let named = to.and_then(|to| path.as_deref().map_or(Ok(()), |path| to.named(path, force)));
        named.or_else(|error| broken(path.as_deref(), error))
    }

    /// Ends the file after a failed write. A closed pipe on stdout is not a failure.
    ///
    /// # Errors
    /// Returns the failure of the write.
    pub(super) fn abandon(self, error: io::Error) -> Result<(), Failure> {
        // Discards the buffer.
        drop(self.to.into_parts());
        broken(self.path.as_deref(), error)
    }
}

fn broken(path: Option<&Path>, error: io::Error) -> Result<(), Failure> {
    let Some(path) = path else {
        print::record_result(Err(error));
        return Ok(());
    };
    Err(Failure::new(Kind::File, format!("{}: {error}", path.display())))
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.to.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}
