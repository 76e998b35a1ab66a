//! Files that a command leaves: never over something that is there, never through a symbolic link, whole or not
//! at all.
//!
//! Recordings (sessions, fault records) are for their owner alone; exports have the permissions that the umask
//! gives. What `--force` replaces is replaced in one step, by renaming.

use std::ffi::OsStr;
use std::fs;
use std::fs::DirBuilder;
use std::fs::File;
use std::fs::OpenOptions;
use std::fs::Permissions;
use std::io;
use std::io::ErrorKind;
use std::io::Write;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use tempfile::NamedTempFile;

use crate::exit::Failure;
use crate::exit::Kind;
use crate::exit::OrFail;

/// Consent to replace results.
#[derive(Clone, Copy, Debug, Args)]
pub struct Force {
    /// Replace results that are there already.
    #[arg(long, requires = "out")]
    pub(super) force: bool,
}

/// Permissions of a file that is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    /// Its owner's alone: 0600.
    Owner,
    /// What the umask gives.
    Umask,
}

impl Access {
    fn permissions(self) -> Permissions {
        Permissions::from_mode(match self {
            Self::Owner => 0o600,
            Self::Umask => 0o666,
        })
    }
}

/// Makes a folder for its owner alone, and those it is in; one that is there stays as it is.
pub(super) fn private_folder(folder: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

/// Makes a new file for its owner alone.
///
/// # Errors
/// When something has this name, a symbolic link for instance.
pub(super) fn private_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)
}

/// Makes a folder for its owner alone in `parent`, under the next free number: `name` makes `001-…` of it.
pub(super) fn numbered(parent: &Path, name: impl Fn(u64) -> String) -> io::Result<PathBuf> {
    private_folder(parent)?;
    let taken = fs::read_dir(parent)?.flatten();
    let taken = taken.filter_map(|entry| number(&entry.file_name()));
    let mut next = taken.max().map_or(1, |last| last.saturating_add(1));
    loop {
        let folder = parent.join(name(next));
        match DirBuilder::new().mode(0o700).create(&folder) {
            // Another run took the number meanwhile.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => next += 1,
            made => return made.map(|()| folder),
        }
    }
}

/// The number a name begins with: `001-…` has 1.
pub(super) fn number(name: &OsStr) -> Option<u64> {
    let (digits, _) = name.to_str()?.split_once('-')?;
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
}

/// Refuses a path where something is already, unless forced. A device or a pipe may be written to.
///
/// # Errors
/// The refusal.
pub fn refuse(path: &Path, force: Force) -> Result<(), Failure> {
    if force.force || is_stream(path) {
        return Ok(());
    }
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error).with_context(|| path.display().to_string()).or_fail(Kind::File),
        Ok(_) => Err(exists(path)),
    }
}

fn exists(path: &Path) -> Failure {
    let path = path.display();
    Failure::new(
        Kind::Usage,
        format!("{path} exists; choose another place, or replace it with --force"),
    )
}

/// Writes a file whole: a temporary one beside it, synced and then renamed. It replaces a file of its name.
pub(super) fn replace(path: &Path, content: &[u8], access: Access) -> io::Result<()> {
    let file = prepare(path, content, access)?;
    file.persist(path).map_err(|error| error.error)?;
    sync_folder(path)
}

/// Writes the file that `--out` names. A device or a pipe is written to as it is.
///
/// # Errors
/// When a file is there and not to be replaced, or cannot be written.
pub fn export(path: &Path, content: &[u8], force: Force) -> Result<(), Failure> {
    let named = || path.display().to_string();
    if is_stream(path) {
        let opened = OpenOptions::new().write(true).open(path);
        let written = opened.and_then(|mut stream| stream.write_all(content));
        return written.with_context(named).or_fail(Kind::File);
    }
    export_all(&[(path.to_path_buf(), content)], force)
}

/// Writes several files: prepares all of them before the first gets its name, so that none is left half done.
///
/// # Errors
/// As [`export`].
pub fn export_all(files: &[(PathBuf, impl AsRef<[u8]>)], force: Force) -> Result<(), Failure> {
    files.iter().try_for_each(|(path, _)| refuse(path, force))?;
    let mut prepared = Vec::new();
    for (path, content) in files {
        let is_free = if path.is_dir() { Err(ErrorKind::IsADirectory.into()) } else { Ok(()) };
        let file = is_free.and_then(|()| prepare(path, content.as_ref(), Access::Umask));
        prepared
            .push((path, file.with_context(|| path.display().to_string()).or_fail(Kind::File)?));
    }
    for (path, file) in prepared {
        let moved = match force.force {
            true => file.persist(path),
            false => file.persist_noclobber(path),
        };
        match moved {
            Err(error) if error.error.kind() == ErrorKind::AlreadyExists => {
                return Err(exists(path));
            }
            moved => moved.with_context(|| path.display().to_string()).or_fail(Kind::File)?,
        };
        sync_folder(path).with_context(|| path.display().to_string()).or_fail(Kind::File)?;
    }
    Ok(())
}

/// A temporary file beside `path` that holds `content` on the disk.
fn prepare(path: &Path, content: &[u8], access: Access) -> io::Result<NamedTempFile> {
    let beside = tempfile::Builder::new()
        .prefix(".frhc-")
        .permissions(access.permissions())
        .tempfile_in(folder_of(path));
    let mut file = beside?;
    file.write_all(content)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// A name that was changed is on the disk once its folder is.
fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder_of(path))?.sync_all()
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| {
        let kind = found.file_type();
        kind.is_char_device() || kind.is_fifo() || kind.is_socket()
    })
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    const KEEP: Force = Force { force: false };
    const FORCE: Force = Force { force: true };

    fn scratch(name: &str) -> PathBuf {
        let folder = crate::scratch::path(name);
        private_folder(&folder).unwrap();
        folder
    }

    fn mode_of(path: &Path) -> u32 {
        fs::symlink_metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn exports_replace_nothing_unless_forced() {
        let folder = scratch("force");
        let file = folder.join("a.dbc");
        export(&file, b"one", KEEP).unwrap();
        let refused = export(&file, b"two", KEEP).unwrap_err().to_string();
        assert!(refused.contains("a.dbc exists; choose another place"), "{refused}");
        assert_eq!(fs::read(&file).unwrap(), b"one");
        export(&file, b"two", FORCE).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"two");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "no temporary file is left");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn symbolic_links_are_never_followed_when_writing() {
        let folder = scratch("links");
        let (other, link) = (folder.join("other"), folder.join("link"));
        fs::write(&other, "mine").unwrap();
        symlink(&other, &link).unwrap();
        assert!(export(&link, b"x", KEEP).is_err());
        assert_eq!(private_file(&link).unwrap_err().kind(), ErrorKind::AlreadyExists);
        export(&link, b"x", FORCE).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_file(), "the link itself was replaced");
        assert_eq!(fs::read(&other).unwrap(), b"mine");
        // One that leads nowhere is there too.
        let dangling = folder.join("dangling");
        symlink(folder.join("nowhere"), &dangling).unwrap();
        assert!(export(&dangling, b"x", KEEP).is_err() && private_file(&dangling).is_err());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_device_is_written_to_and_stays_a_device() {
        let failed = export(Path::new("/dev/full"), b"x", KEEP).unwrap_err().to_string();
        assert!(failed.starts_with("/dev/full: No space left"), "{failed}");
        export(Path::new("/dev/null"), b"x", KEEP).unwrap();
        assert!(is_stream(Path::new("/dev/null")));
    }

    #[test]
    fn recordings_are_their_owners_alone() {
        let folder = scratch("private");
        assert_eq!(mode_of(&folder), 0o700);
        let (log, document) = (folder.join("bus.log"), folder.join("fault.json"));
        private_file(&log).unwrap();
        replace(&document, b"{}", Access::Owner).unwrap();
        replace(&document, b"{ }", Access::Owner).unwrap();
        assert_eq!((mode_of(&log), mode_of(&document)), (0o600, 0o600));
        assert_eq!(fs::read(&document).unwrap(), b"{ }");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn numbered_folders_count_on_and_never_meet() {
        let folder = scratch("numbers");
        let name = |number| format!("{number:03}-now");
        assert_eq!(numbered(&folder, name).unwrap(), folder.join("001-now"));
        assert_eq!(numbered(&folder, name).unwrap(), folder.join("002-now"));
        fs::create_dir(folder.join("041-earlier")).unwrap();
        fs::write(folder.join("notes"), "").unwrap();
        symlink(folder.join("notes"), folder.join("042-now")).unwrap();
        assert_eq!(numbered(&folder, name).unwrap(), folder.join("043-now"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
