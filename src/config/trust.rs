//! Write permissions of configuration files. A file that configures drives must not be writable by other users.
//!
//! Files writable by their group are refused unless the group is private. By convention, a group whose gid is the uid of
//! its owner has no other members. Checkouts with a umask of 002 have many such files.

use std::fs::{self, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Required write protection of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trust {
    /// No protection, for commands that move nothing.
    #[default]
    Any,
    /// Not writable by other users, for commands that configure drives.
    Guarded,
}

/// Reason to refuse a file with insufficient protection.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum TrustError {
    /// Symbolic link: the owner of the link selects the file.
    #[error("is a symbolic link: name the file itself, or say --insecure")]
    Link,
    /// Pipe or device: each read may return other content.
    #[error("is not a regular file: name one, or say --insecure")]
    Irregular,
    /// Writable by all users.
    #[error("anyone may write it (mode {mode:04o}): chmod o-w it, or say --insecure")]
    WorldWritableFile {
        /// Permission bits.
        mode: u32,
    },
    /// Writable by a group that is not private to its owner.
    #[error("its group may write it (mode {mode:04o}): chmod g-w it, or say --insecure")]
    GroupWritableFile {
        /// Permission bits.
        mode: u32,
    },
    /// Replaceable by all users, because a folder of its path is writable.
    #[error("anyone may write {folder} (mode {mode:04o}): chmod o-w it, or say --insecure")]
    WorldWritableFolder {
        /// Writable folder.
        folder: PathBuf,
        /// Permission bits.
        mode: u32,
    },
    /// Owned by another user, who can change its mode.
    #[error(
        "{}belongs to user {uid}, must belong to root or to user {own}: chown it, or say --insecure",
        folder_of(.folder.as_deref())
    )]
    ForeignOwner {
        /// Folder of its path; `None` for the file itself.
        folder: Option<PathBuf>,
        /// User id of the owner.
        uid: u32,
        /// User id of this process.
        own: u32,
    },
    /// Replaced between its inspection and its opening.
    #[error("was replaced while it was opened")]
    Replaced,
}

impl From<TrustError> for io::Error {
    fn from(reason: TrustError) -> Self {
        Self::new(io::ErrorKind::PermissionDenied, reason)
    }
}

/// Identity of an inspected file, to be compared once it is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InspectedFile {
    device: u64,
    inode: u64,
}

impl InspectedFile {
    /// Inspects a file and the folders of its path without opening them, because opening a pipe waits for a writer.
    ///
    /// # Errors
    /// When another user may write the file or a folder, or metadata cannot be read.
    pub(super) fn inspect(path: &Path) -> io::Result<Self> {
        let found = fs::symlink_metadata(path)?;
        check_file(&found)?;
        let owners = Owners::known();
        owners.check(None, found.uid())?;
        let here = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = fs::canonicalize(here.unwrap_or(Path::new(".")))?;
        for folder in folder.ancestors() {
            let found = fs::metadata(folder)?;
            check_folder(folder, found.mode())?;
            owners.check(Some(folder), found.uid())?;
        }
        Ok(Self { device: found.dev(), inode: found.ino() })
    }

    /// Checks that the opened file is the inspected one and still protected.
    ///
    /// # Errors
    /// When the file was replaced, or other users may write it.
    pub(super) fn verify(self, opened: &Metadata) -> Result<(), TrustError> {
        if (opened.dev(), opened.ino()) != (self.device, self.inode) {
            return Err(TrustError::Replaced);
        }
        check_file(opened)
    }
}

fn folder_of(folder: Option<&Path>) -> String {
    folder.map(|folder| format!("{} ", folder.display())).unwrap_or_default()
}

/// Trusted owners of files besides root: the user of this process, and the owner of its executable, who controls its
/// behaviour anyway.
#[derive(Clone, Copy, Debug)]
struct Owners {
    own: u32,
    program: u32,
}

impl Owners {
    fn known() -> Self {
        let own = nix::unistd::geteuid().as_raw();
        let program = fs::metadata("/proc/self/exe").map_or(own, |program| program.uid());
        Self { own, program }
    }

    fn check(self, folder: Option<&Path>, uid: u32) -> Result<(), TrustError> {
        let Self { own, program } = self;
        if [0, own, program].contains(&uid) {
            Ok(())
        } else {
            Err(TrustError::ForeignOwner { folder: folder.map(Path::to_path_buf), uid, own })
        }
    }
}

fn check_file(file: &Metadata) -> Result<(), TrustError> {
    if file.is_symlink() {
        return Err(TrustError::Link);
    }
    if !file.is_file() {
        return Err(TrustError::Irregular);
    }
    check_mode(file.mode(), file.uid() == file.gid())
}

fn check_mode(mode: u32, group_is_private: bool) -> Result<(), TrustError> {
    let mode = mode & PERMISSIONS;
    if mode & OTHERS_WRITE != 0 {
        Err(TrustError::WorldWritableFile { mode })
    } else if mode & GROUP_WRITES != 0 && !group_is_private {
        Err(TrustError::GroupWritableFile { mode })
    } else {
        Ok(())
    }
}

/// Refuses a world-writable folder without the sticky bit. With the sticky bit, only owners can replace their files.
fn check_folder(folder: &Path, mode: u32) -> Result<(), TrustError> {
    let mode = mode & PERMISSIONS;
    if mode & OTHERS_WRITE != 0 && mode & STICKY == 0 {
        return Err(TrustError::WorldWritableFolder { folder: folder.to_path_buf(), mode });
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
    fn hazard_18_file_writable_by_others_is_refused_in_every_mode() {
        for mode in 0..=0o777 {
            let of = |private| check_mode(0o100_000 | mode, private);
            let world = Err(TrustError::WorldWritableFile { mode });
            let group = Err(TrustError::GroupWritableFile { mode });
            match (mode & OTHERS_WRITE != 0, mode & GROUP_WRITES != 0) {
                (true, _) => assert_eq!((of(true), of(false)), (world.clone(), world)),
                (false, true) => assert_eq!((of(true), of(false)), (Ok(()), group)),
                (false, false) => assert_eq!((of(true), of(false)), (Ok(()), Ok(()))),
            }
        }
    }

    #[test]
    fn hazard_18_files_of_other_users_are_refused() {
        let (folder, root) = (Path::new("/srv"), Owners { own: 0, program: 0 });
        assert_eq!(root.check(None, 0), Ok(()));
        assert_eq!(
            root.check(Some(folder), 1_000).unwrap_err().to_string(),
            "/srv belongs to user 1000, must belong to root or to user 0: chown it, or say --insecure"
        );
        let engineer = Owners { own: 1_000, program: 500 };
        assert!([0, 500, 1_000].iter().all(|uid| engineer.check(None, *uid).is_ok()));
        assert!([1, 501, 1_001, u32::MAX].iter().all(|uid| engineer.check(None, *uid).is_err()));
    }

    #[test]
    fn hazard_18_world_writable_folder_needs_the_sticky_bit() {
        let folder = Path::new("/etc/frhc");
        assert!(check_folder(folder, 0o040_755).is_ok());
        assert!(check_folder(folder, 0o041_777).is_ok());
        let refused = check_folder(folder, 0o040_777).unwrap_err().to_string();
        assert!(refused.starts_with("anyone may write /etc/frhc (mode 0777): chmod o-w"));
    }
}
