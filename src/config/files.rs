//! Configuration files from disk, or the copies built into the program for `frhc demo`.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use nix::libc::{O_NOCTTY, O_NOFOLLOW, O_NONBLOCK};

use crate::shipped;
use crate::trust::{InspectedFile, Trust};

/// Maximum size of a configuration or an EDS, in bytes.
const MAX_SIZE: u64 = 4 << 20;

/// Contents of files by path.
pub type Copies = BTreeMap<PathBuf, Arc<[u8]>>;

/// Files that a configuration consists of. Each is read once; its content is kept for a recording.
#[derive(Clone, Debug)]
pub struct Files {
    /// Required protection of files on disk; `None` if only copies are read.
    trust: Option<Trust>,
    read: Rc<RefCell<Copies>>,
}

impl Files {
    /// Reads from disk, and shipped files that are not there from the program.
    pub fn on_disk(trust: Trust) -> Self {
        Self { trust: Some(trust), read: Rc::default() }
    }

    /// Reads from these copies alone.
    pub fn copied(copies: Copies) -> Self {
        Self { trust: None, read: Rc::new(RefCell::new(copies)) }
    }

    /// Replaces the content of a file.
    #[must_use]
    pub fn with(self, path: &Path, content: impl Into<Arc<[u8]>>) -> Self {
        self.read.borrow_mut().insert(path.to_path_buf(), content.into());
        self
    }

    /// Returns whether only copies are read: the files of a recorded session.
    pub const fn are_recorded(&self) -> bool {
        self.trust.is_none()
    }

    /// Returns everything that was read.
    pub fn copies(&self) -> Copies {
        self.read.borrow().clone()
    }

    /// Returns the content of a file.
    ///
    /// # Errors
    /// As [`read_by`], or `NotFound` if only copies are read and none has this path.
    pub fn read(&self, path: &Path) -> io::Result<Arc<[u8]>> {
        if let Some(known) = self.read.borrow().get(path) {
            return Ok(Arc::clone(known));
        }
        let trust = self.trust.ok_or(io::ErrorKind::NotFound)?;
        let content: Arc<[u8]> = read_by(trust, path)?.into();
        self.read.borrow_mut().insert(path.to_path_buf(), Arc::clone(&content));
        Ok(content)
    }
}

/// Returns the bytes of a file on disk, or of the shipped copy if the file does not exist.
///
/// # Errors
/// When neither exists, or the file is not regular, cannot be read or is larger than 4 MiB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_by(Trust::Any, path)
}

/// Returns the bytes of a file with the required protection. A shipped copy always has it.
///
/// # Errors
/// As [`read`], and when another user may write the file.
pub fn read_by(trust: Trust, path: &Path) -> io::Result<Vec<u8>> {
    let file = match trust {
        Trust::Any => open(path),
        Trust::Guarded => guarded(path),
    };
    match file {
        Ok(file) => at_most(MAX_SIZE, file),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            shipped::file(path).map(<[u8]>::to_vec).ok_or(error)
        }
        Err(error) => Err(error),
    }
}

/// Opens a regular file, following symbolic links. Other types are refused before opening: a pipe without a writer
/// blocks, and opening a device has side effects.
///
/// # Errors
/// When the file cannot be opened, or is not regular.
pub fn open(path: &Path) -> io::Result<File> {
    check_regular(&fs::metadata(path)?)?;
    let file = OpenOptions::new().read(true).custom_flags(O_NONBLOCK | O_NOCTTY).open(path)?;
    // The file may have been replaced since.
    check_regular(&file.metadata()?)?;
    Ok(file)
}

/// Opens a regular file like [`open`], but refuses symbolic links.
///
/// # Errors
/// As [`open`], and for a symbolic link.
pub fn open_unlinked(path: &Path) -> io::Result<File> {
    if !fs::symlink_metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "must be a regular file"));
    }
    let flags = O_NONBLOCK | O_NOCTTY | O_NOFOLLOW;
    let file = OpenOptions::new().read(true).custom_flags(flags).open(path)?;
    check_regular(&file.metadata()?)?;
    Ok(file)
}

/// Reads `input` to its end, at most `max_bytes`.
///
/// # Errors
/// When `input` cannot be read, or is longer.
pub fn at_most(max_bytes: u64, input: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    input.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if u64::try_from(bytes.len()).is_ok_and(|length| length <= max_bytes) {
        Ok(bytes)
    } else {
        let reason = format!("larger than {} MiB", max_bytes >> 20);
        Err(io::Error::new(io::ErrorKind::FileTooLarge, reason))
    }
}

/// Refuses a file that is not regular, and names its type.
fn check_regular(found: &Metadata) -> io::Result<()> {
    let kind = found.file_type();
    let (error, what) = if kind.is_file() {
        return Ok(());
    } else if kind.is_dir() {
        (io::ErrorKind::IsADirectory, "directory")
    } else if kind.is_fifo() {
        (io::ErrorKind::InvalidInput, "pipe")
    } else if kind.is_socket() {
        (io::ErrorKind::InvalidInput, "socket")
    } else {
        (io::ErrorKind::InvalidInput, "device")
    };
    Err(io::Error::new(error, format!("is a {what}, must be a regular file")))
}

/// Opens a file that other users cannot write. It must still be the inspected file once it is open.
fn guarded(path: &Path) -> io::Result<File> {
    let at_path = fs::symlink_metadata(path)?;
    if !at_path.is_symlink() {
        check_regular(&at_path)?;
    }
    let inspected = InspectedFile::inspect(path)?;
    let file = open(path)?;
    inspected.verify(&file.metadata()?)?;
    Ok(file)
}

/// Resolves `name`, as written in `file`, relative to the folder of `file`. `..` does not follow symbolic links.
pub fn beside(file: &Path, name: &str) -> PathBuf {
    let mut path = file.parent().unwrap_or(Path::new("")).to_path_buf();
    for part in Path::new(name).components() {
        if part == Component::ParentDir && path.file_name().is_some() {
            path.pop();
        } else if part != Component::CurDir {
            path.push(part);
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_is_resolved_from_the_folder_of_its_file() {
        let path = beside(Path::new("config/kraft_like.toml"), "../eds/frhc_drive.eds");
        assert_eq!(path, Path::new("eds/frhc_drive.eds"));
        assert_eq!(beside(Path::new("/etc/frhc/a.toml"), "b.eds"), Path::new("/etc/frhc/b.eds"));
    }

    #[test]
    fn missing_file_is_not_found() {
        assert_eq!(
            read(Path::new("config/none.toml")).unwrap_err().kind(),
            io::ErrorKind::NotFound
        );
    }
}
