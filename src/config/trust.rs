//! Whose word a file is. What others may write is theirs, and drives are told nothing on the word of others.
//!
//! A file writable by its group is refused only where the group has other members for all we know: by the
//! custom of private groups one that has its owner's number has none, and checkouts with a umask of 002 are
//! full of those.

use std::fs;
use std::fs::Metadata;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::path::PathBuf;

use thiserror::Error;

/// Which files are read at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trust {
    /// Every one: nothing moves by it.
    #[default]
    Any,
    /// Those that nobody else may write: drives are told what they say.
    Guarded,
}

/// Why a file is not read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Distrusted {
    /// Whoever may write the link decides what is read.
    #[error("is a symbolic link: name the file itself, or say --insecure")]
    Link,
    /// A pipe or a device says something else each time.
    #[error("is no regular file: name one, or say --insecure")]
    Irregular,
    /// Its mode lets everybody write it.
    #[error("anyone may write it (mode {mode:04o}): chmod o-w it, or say --insecure")]
    AnyonesFile {
        /// Its permissions.
        mode: u32,
    },
    /// Its mode lets a group write it that is not its owner's own.
    #[error("its group may write it (mode {mode:04o}): chmod g-w it, or say --insecure")]
    GroupsFile {
        /// Its permissions.
        mode: u32,
    },
    /// A folder on the way to it lets everybody put another one in its place.
    #[error("anyone may write {folder} (mode {mode:04o}): chmod o-w it, or say --insecure")]
    AnyonesFolder {
        /// Which.
        folder: PathBuf,
        /// Its permissions.
        mode: u32,
    },
    /// Between two looks it became another file.
    #[error("was replaced while it was opened")]
    Replaced,
}

impl From<Distrusted> for io::Error {
    fn from(reason: Distrusted) -> Self {
        Self::new(io::ErrorKind::PermissionDenied, reason)
    }
}

/// What stood at a path, to be recognised once it is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Guarded {
    device: u64,
    inode: u64,
}

impl Guarded {
    /// Looks at a path and the folders on the way, opening nothing: a pipe would wait for its writer.
    ///
    /// # Errors
    /// When somebody else may write one of them, or it cannot be looked at.
    pub(super) fn inspect(path: &Path) -> io::Result<Self> {
        let found = fs::symlink_metadata(path)?;
        judge_file(&found)?;
        let here = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = fs::canonicalize(here.unwrap_or(Path::new(".")))?;
        for folder in folder.ancestors() {
            judge_folder(folder, fs::metadata(folder)?.mode())?;
        }
        Ok(Self { device: found.dev(), inode: found.ino() })
    }

    /// Whether what was opened is what was looked at, and still nobody else's.
    ///
    /// # Errors
    /// When it is not.
    pub(super) fn recognise(self, opened: &Metadata) -> Result<(), Distrusted> {
        if (opened.dev(), opened.ino()) != (self.device, self.inode) {
            return Err(Distrusted::Replaced);
        }
        judge_file(opened)
    }
}

fn judge_file(file: &Metadata) -> Result<(), Distrusted> {
    if file.is_symlink() {
        return Err(Distrusted::Link);
    }
    if !file.is_file() {
        return Err(Distrusted::Irregular);
    }
    judge_mode(file.mode(), file.uid() == file.gid())
}

fn judge_mode(mode: u32, group_is_private: bool) -> Result<(), Distrusted> {
    let mode = mode & PERMISSIONS;
    if mode & OTHERS_WRITE != 0 {
        Err(Distrusted::AnyonesFile { mode })
    } else if mode & GROUP_WRITES != 0 && !group_is_private {
        Err(Distrusted::GroupsFile { mode })
    } else {
        Ok(())
    }
}

/// In a folder like /tmp everybody may put files, but nobody may replace those of others.
fn judge_folder(folder: &Path, mode: u32) -> Result<(), Distrusted> {
    let mode = mode & PERMISSIONS;
    if mode & OTHERS_WRITE != 0 && mode & STICKY == 0 {
        return Err(Distrusted::AnyonesFolder { folder: folder.to_path_buf(), mode });
    }
    Ok(())
}

const PERMISSIONS: u32 = 0o7777;
const STICKY: u32 = 0o1000;
const GROUP_WRITES: u32 = 0o020;
const OTHERS_WRITE: u32 = 0o002;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hazard_18_what_others_may_write_is_refused_whatever_else_its_mode_is() {
        for mode in 0..=0o777 {
            let of = |private| judge_mode(0o100_000 | mode, private);
            let anyones = Err(Distrusted::AnyonesFile { mode });
            let groups = Err(Distrusted::GroupsFile { mode });
            match (mode & OTHERS_WRITE != 0, mode & GROUP_WRITES != 0) {
                (true, _) => assert_eq!((of(true), of(false)), (anyones.clone(), anyones)),
                (false, true) => assert_eq!((of(true), of(false)), (Ok(()), groups)),
                (false, false) => assert_eq!((of(true), of(false)), (Ok(()), Ok(()))),
            }
        }
    }

    #[test]
    fn hazard_18_a_folder_everybody_may_write_is_refused_unless_it_is_sticky() {
        let folder = Path::new("/etc/frhc");
        assert!(judge_folder(folder, 0o040_755).is_ok());
        assert!(judge_folder(folder, 0o041_777).is_ok());
        let refused = judge_folder(folder, 0o040_777).unwrap_err().to_string();
        assert!(refused.starts_with("anyone may write /etc/frhc (mode 0777): chmod o-w"));
    }
}
