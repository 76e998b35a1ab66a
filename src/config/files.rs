//! Where configuration text comes from: the disk, or the copies shipped inside the program, so that
//! `frhc demo` runs anywhere.

use std::fs;
use std::fs::File;
use std::fs::Metadata;
use std::fs::OpenOptions;
use std::io;
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Component;
use std::path::Path;
use std::path::PathBuf;

use nix::libc::O_NOCTTY;
use nix::libc::O_NONBLOCK;

use crate::problem::Invalid;
use crate::problem::Problem;
use crate::shipped;
use crate::trust::Guarded;
use crate::trust::Trust;

/// Longest configuration or data sheet, in bytes.
const LIMIT: u64 = 4 << 20;

/// The bytes of `path`: of the file on disk if there is one, else of the shipped copy of that name.
///
/// # Errors
/// When there is neither, or the file is no regular one, cannot be read or is larger than 4 MiB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_by(Trust::Any, path)
}

/// The same of a file that must be worth that trust; a shipped copy always is.
///
/// # Errors
/// As [`read`], and when somebody else may write it.
pub fn read_by(trust: Trust, path: &Path) -> io::Result<Vec<u8>> {
    let file = match trust {
        Trust::Any => open(path),
        Trust::Guarded => guarded(path),
    };
    match file {
        Ok(file) => at_most(LIMIT, file),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            shipped::file(path).map(<[u8]>::to_vec).ok_or(error)
        }
        Err(error) => Err(error),
    }
}

/// Opens a regular file, or the file a link names, and waits for nothing: a pipe without a writer would keep
/// its reader for ever, and opening a device can do things.
///
/// # Errors
/// When it cannot be opened, or is anything else than a regular file.
pub fn open(path: &Path) -> io::Result<File> {
    is_regular(&fs::metadata(path)?)?;
    let file = OpenOptions::new().read(true).custom_flags(O_NONBLOCK | O_NOCTTY).open(path)?;
    // Another one may stand there by now.
    is_regular(&file.metadata()?)?;
    Ok(file)
}

/// Reads `input` to its end, which must come within `most` bytes.
///
/// # Errors
/// When it cannot be read, or is longer.
pub fn at_most(most: u64, input: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    input.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if u64::try_from(bytes.len()).is_ok_and(|length| length <= most) {
        Ok(bytes)
    } else {
        let reason = format!("larger than {} MiB", most >> 20);
        Err(io::Error::new(io::ErrorKind::FileTooLarge, reason))
    }
}

/// Names what a file is that cannot be read as one.
fn is_regular(found: &Metadata) -> io::Result<()> {
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

/// A file that nobody else may write: the one that is open is the one that was looked at.
fn guarded(path: &Path) -> io::Result<File> {
    let at_path = fs::symlink_metadata(path)?;
    if !at_path.is_symlink() {
        is_regular(&at_path)?;
    }
    let found = Guarded::inspect(path)?;
    let file = open(path)?;
    found.recognise(&file.metadata()?)?;
    Ok(file)
}

/// The same as text.
///
/// # Errors
/// As [`read_by`], in the words of a configuration.
pub(super) fn text(trust: Trust, file: &Path) -> Result<String, Invalid> {
    let alone = |reason: String| {
        let file = file.to_path_buf();
        Invalid(vec![Problem { file, line: None, key: String::new(), reason }])
    };
    let bytes = read_by(trust, file).map_err(|error| alone(error.to_string()))?;
    String::from_utf8(bytes).map_err(|error| alone(error.to_string()))
}

/// `name` as written in `file`, seen from that file's folder; `..` is resolved in the name alone.
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
    fn a_name_is_seen_from_the_file_that_says_it() {
        let seen = beside(Path::new("config/kraft_like.toml"), "../eds/frhc_drive.eds");
        assert_eq!(seen, Path::new("eds/frhc_drive.eds"));
        assert_eq!(beside(Path::new("/etc/frhc/a.toml"), "b.eds"), Path::new("/etc/frhc/b.eds"));
    }

    #[test]
    fn what_is_not_there_is_not_found() {
        assert_eq!(
            read(Path::new("config/none.toml")).unwrap_err().kind(),
            io::ErrorKind::NotFound
        );
    }
}
