//! A file of any size that a command writes: under its name once it is complete, and for its owner only.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, IntoInnerError, Write};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::path::{Path, PathBuf};

use anyhow::Context;
use tempfile::NamedTempFile;

use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Force};

/// Name of stdout in messages.
const STDOUT: &str = "stdout";

/// Size of the buffer, in bytes.
const BUFFER: usize = 1 << 17;

/// A file being written. Dropped before [`finish`](Self::finish), it leaves nothing.
#[derive(Debug)]
pub(super) struct WholeFile {
    path: PathBuf,
    force: Force,
    to: BufWriter<Target>,
}

#[derive(Debug)]
enum Target {
    /// A temporary file beside the path.
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
    /// Gives a temporary file its name.
    fn named(self, path: &Path, force: Force) -> io::Result<()> {
        let Self::Beside(file) = self else { return Ok(()) };
        file.as_file().sync_all()?;
        let moved =
            if force.is_given() { file.persist(path) } else { file.persist_noclobber(path) };
        moved.map(drop).map_err(|error| error.error)
    }
}

impl WholeFile {
    /// Begins a file at a path, or on stdout without one.
    ///
    /// # Errors
    /// It exists and `force` is not given, or its folder cannot be written.
    pub(super) fn create(path: Option<&Path>, force: Force) -> Result<Self, Failure> {
        let Some(path) = path else {
            let stdout = print::data().and_then(File::try_clone).context("stdout");
            let stdout = stdout.or_fail(Kind::File)?;
            return Ok(Self::new(Path::new(STDOUT), force, Target::Stream(stdout)));
        };
        results::ensure_free(path, force)?;
        let target =
            target(path).with_context(|| path.display().to_string()).or_fail(Kind::File)?;
        Ok(Self::new(path, force, target))
    }

    fn new(path: &Path, force: Force, target: Target) -> Self {
        Self { path: path.to_path_buf(), force, to: BufWriter::with_capacity(BUFFER, target) }
    }

    /// Gives the file its name, once its content is on the disk.
    ///
    /// # Errors
    /// A write has failed, or the path is taken by now.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let Self { path, force, to } = self;
        let is_stdout = path.as_os_str() == STDOUT;
        match to
            .into_inner()
            .map_err(IntoInnerError::into_error)
            .and_then(|to| to.named(&path, force))
        {
            Err(error) => broken(&path, is_stdout, error),
            Ok(()) => Ok(()),
        }
    }

    /// Ends the file after a failed write. A closed pipe on stdout is no failure.
    ///
    /// # Errors
    /// The failure of the write.
    pub(super) fn abandon(self, error: io::Error) -> Result<(), Failure> {
        let (path, to) = (self.path, self.to);
        // What is buffered is not written.
        drop(to.into_parts());
        broken(&path, path.as_os_str() == STDOUT, error)
    }
}

fn broken(path: &Path, is_stdout: bool, error: io::Error) -> Result<(), Failure> {
    if is_stdout {
        print::record_result(Err(error));
        return Ok(());
    }
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

fn target(path: &Path) -> io::Result<Target> {
    let is_stream = fs::metadata(path).is_ok_and(|found| {
        let kind = found.file_type();
        kind.is_char_device() || kind.is_fifo() || kind.is_socket()
    });
    if is_stream {
        return OpenOptions::new().write(true).open(path).map(Target::Stream);
    }
    if path.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let beside = tempfile::Builder::new()
        .prefix(".frhc-")
        .permissions(fs::Permissions::from_mode(0o600))
        .tempfile_in(folder.unwrap_or(Path::new(".")))?;
    Ok(Target::Beside(beside))
}
