//! Output files of commands, written atomically, never over an existing file and never through a symbolic link.
//!
//! Recordings (sessions, fault records) are readable by their owner only; exports have the permissions of the umask.
//! `--force` replaces a file in one step, by renaming.

use std::ffi::OsStr;
use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use tempfile::NamedTempFile;

use crate::exit::{Failure, Kind, OrFail};

/// Maximum number of attempts at a folder that other runs interfere with.
const MAX_ATTEMPTS: u32 = 100;

/// Permission to replace existing results.
#[derive(Clone, Copy, Debug, Args)]
pub struct Force {
    /// Replace existing results.
    #[arg(long, requires = "out")]
    pub force: bool,
}

/// Permissions of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Owner only: 0600.
    Owner,
    /// Owner and group, regardless of the umask: 0660.
    Group,
    /// 0666 less the umask.
    Umask,
}

impl Access {
    pub(super) fn permissions(self) -> Permissions {
        Permissions::from_mode(match self {
            Self::Owner => 0o600,
            Self::Group => 0o660,
            Self::Umask => 0o666,
        })
    }
}

/// Creates a folder and its parents for their owner only; does not change an existing one.
///
/// # Errors
/// When the folder cannot be created.
pub fn private_folder(folder: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

/// Creates a file for its owner only.
///
/// # Errors
/// When the name is taken, also by a symbolic link.
pub(super) fn private_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)
}

/// Creates a folder for its owner only in `parent`, with the next free number; `name` formats it as `001-…`.
pub(super) fn create_numbered(parent: &Path, name: impl Fn(u64) -> String) -> io::Result<PathBuf> {
    let mut created = Err(ErrorKind::NotFound.into());
    for _ in 0..MAX_ATTEMPTS {
        private_folder(parent)?;
        let taken = fs::read_dir(parent)?.flatten();
        let taken = taken.filter_map(|entry| number(&entry.file_name()));
        let folder = parent.join(name(taken.max().map_or(1, |last| last.saturating_add(1))));
        created = DirBuilder::new().mode(0o700).create(&folder).map(|()| folder);
        match &created {
            // Another run has taken the number or removed the empty parent meanwhile.
            Err(error)
                if [ErrorKind::AlreadyExists, ErrorKind::NotFound].contains(&error.kind()) => {}
            Ok(_) | Err(_) => break,
        }
    }
    created
}

/// Returns the number at the start of a name: 1 of `001-…`.
pub(super) fn number(name: &OsStr) -> Option<u64> {
    let (digits, _) = name.to_str()?.split_once('-')?;
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
}

/// Removes each numbered entry of `folder` by `remove`, and the folder if nothing else is in it. A symbolic link is
/// removed instead of its target.
pub(super) fn clear_numbered(folder: &Path, remove: impl Fn(&Path)) -> io::Result<()> {
    match fs::symlink_metadata(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
        Ok(found) if !found.is_dir() => return fs::remove_file(folder),
        Ok(_) => {}
    }
    let entries = fs::read_dir(folder)?.flatten();
    let numbered = entries.filter(|entry| number(&entry.file_name()).is_some());
    numbered.for_each(|entry| remove(&entry.path()));
    fs::remove_dir(folder).ok();
    Ok(())
}

/// Returns an error if the path cannot be written, or exists, unless forced. Devices and pipes are accepted.
///
/// # Errors
/// When the path exists, cannot be inspected, or cannot be written.
pub fn ensure_free(path: &Path, force: Force) -> Result<(), Failure> {
    ensure_not_taken(path, force)?;
    if is_stream(path) { Ok(()) } else { ensure_writable(path) }
}

/// Returns an error if the path exists, unless forced. Devices and pipes are accepted.
fn ensure_not_taken(path: &Path, force: Force) -> Result<(), Failure> {
    if force.force || is_stream(path) {
        return Ok(());
    }
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error).with_context(|| path.display().to_string()).or_fail(Kind::File),
        Ok(_) => Err(exists(path)),
    }
}

/// Returns an error if nothing can be created at `path`: a command finds that before it computes for minutes.
///
/// # Errors
/// Returns an error if the nearest existing folder above is not writable.
pub fn ensure_writable(path: &Path) -> Result<(), Failure> {
    let above = path.ancestors().skip(1).find(|above| above.exists());
    let above = above.unwrap_or(Path::new("."));
    let probed = temporary_in(above, Access::Owner).map(drop);
    probed
        .with_context(|| format!("{}: cannot write in {}", path.display(), above.display()))
        .or_fail(Kind::File)
}

fn exists(path: &Path) -> Failure {
    let path = path.display();
    Failure::new(
        Kind::Usage,
        format!("{path} exists; choose another path, or replace it with --force"),
    )
}

/// Writes a file atomically, by writing, syncing and renaming a temporary file beside it. Replaces an existing file.
pub(super) fn replace(path: &Path, content: &[u8], access: Access) -> io::Result<()> {
    let file = prepare(path, content, access)?;
    file.persist(path).map_err(|error| error.error)?;
    sync_folder(path)
}

/// Writes the file given by `--out`. Writes directly to a device or pipe.
///
/// # Errors
/// When the file exists and `--force` is not given, or cannot be written.
pub fn export(path: &Path, content: &[u8], force: Force) -> Result<(), Failure> {
    let named = || path.display().to_string();
    if is_stream(path) {
        let opened = OpenOptions::new().write(true).open(path);
        let written = opened.and_then(|mut stream| stream.write_all(content));
        return written.with_context(named).or_fail(Kind::File);
    }
    export_all(&[(path.to_path_buf(), content)], force)
}

/// Writes several files. All are prepared before the first is renamed, so that a failure leaves none.
///
/// # Errors
/// As [`export`].
pub fn export_all(files: &[(PathBuf, impl AsRef<[u8]>)], force: Force) -> Result<(), Failure> {
    write_all(files, force, Access::Umask)
}

/// Writes several files of a recording, as [`export_all`] does, for their owner only.
///
/// # Errors
/// As [`export`].
pub fn record_all(files: &[(PathBuf, impl AsRef<[u8]>)], force: Force) -> Result<(), Failure> {
    write_all(files, force, Access::Owner)
}

fn write_all(
    files: &[(PathBuf, impl AsRef<[u8]>)],
    force: Force,
    access: Access,
) -> Result<(), Failure> {
    files.iter().try_for_each(|(path, _)| ensure_not_taken(path, force))?;
    let mut prepared = Vec::new();
    for (path, content) in files {
        let is_free = if path.is_dir() { Err(ErrorKind::IsADirectory.into()) } else { Ok(()) };
        let file = is_free.and_then(|()| prepare(path, content.as_ref(), access));
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

/// Writes and syncs `content` to a temporary file beside `path`.
fn prepare(path: &Path, content: &[u8], access: Access) -> io::Result<NamedTempFile> {
    let mut file = beside(path, access)?;
    if access == Access::Group {
        file.as_file().set_permissions(access.permissions())?;
    }
    file.write_all(content)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// Creates a temporary file beside `path`.
///
/// # Errors
/// When the file cannot be created.
pub fn beside(path: &Path, access: Access) -> io::Result<NamedTempFile> {
    temporary_in(folder_of(path), access)
}

/// Creates a temporary file. The error does not name it.
fn temporary_in(folder: &Path, access: Access) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    let created = builder.prefix(".frhc-").permissions(access.permissions()).tempfile_in(folder);
    created.map_err(|error| {
        let text = error.to_string();
        let reason = text.split(" at path ").next().unwrap_or(&text);
        io::Error::new(error.kind(), reason.to_owned())
    })
}

/// Syncs the folder of `path`, which makes a renaming durable.
///
/// # Errors
/// When the folder cannot be synced.
pub fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder_of(path))?.sync_all()
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Returns whether `path` is a device, pipe or socket, which is written to directly.
pub fn is_stream(path: &Path) -> bool {
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
        assert!(refused.contains("a.dbc exists; choose another path"), "{refused}");
        assert_eq!(fs::read(&file).unwrap(), b"one");
        export(&file, b"two", FORCE).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"two");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "no temporary file is left");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn unwritable_path_is_refused_and_nothing_is_left() {
        let folder = scratch("writable");
        let below_a_file = folder.join("file").join("below.csv");
        fs::write(folder.join("file"), "").unwrap();
        let refused = |path: &Path| ensure_free(path, KEEP).unwrap_err().to_string();
        let below = refused(&below_a_file);
        assert!(
            below.contains("below.csv: Not a directory") && !below.contains(".frhc-"),
            "{below}"
        );
        let in_proc = refused(Path::new("/proc/frhc/x.csv"));
        assert!(in_proc.contains("/proc/frhc/x.csv: cannot write in /proc: "), "{in_proc}");
        assert!(!in_proc.contains(".frhc-"), "{in_proc}");
        for force in [KEEP, FORCE] {
            assert!(ensure_free(Path::new("/proc/frhc/x.csv"), force).is_err());
            ensure_free(&folder.join("new").join("deeper").join("x.csv"), force).unwrap();
        }
        assert_eq!(
            fs::read_dir(&folder).unwrap().count(),
            1,
            "neither folders nor temporary files"
        );
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
        // A dangling link is not followed either.
        let dangling = folder.join("dangling");
        symlink(folder.join("nowhere"), &dangling).unwrap();
        assert!(export(&dangling, b"x", KEEP).is_err() && private_file(&dangling).is_err());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn export_to_a_device_writes_to_it_and_keeps_it() {
        let failed = export(Path::new("/dev/full"), b"x", KEEP).unwrap_err().to_string();
        assert!(failed.starts_with("/dev/full: No space left"), "{failed}");
        export(Path::new("/dev/null"), b"x", KEEP).unwrap();
        assert!(is_stream(Path::new("/dev/null")));
    }

    #[test]
    fn recordings_are_readable_by_their_owner_only() {
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
    fn numbered_folders_continue_after_the_highest_number() {
        let folder = scratch("numbers");
        let name = |number| format!("{number:03}-now");
        assert_eq!(create_numbered(&folder, name).unwrap(), folder.join("001-now"));
        assert_eq!(create_numbered(&folder, name).unwrap(), folder.join("002-now"));
        fs::create_dir(folder.join("041-earlier")).unwrap();
        fs::write(folder.join("notes"), "").unwrap();
        symlink(folder.join("notes"), folder.join("042-now")).unwrap();
        assert_eq!(create_numbered(&folder, name).unwrap(), folder.join("043-now"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
