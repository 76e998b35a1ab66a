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
    /// It belongs to another user, who may write it whatever its mode says.
    #[error(
        "{}belongs to user {uid}, must belong to root or to user {own}: chown it, or say --insecure",
        folder_of(.folder.as_deref())
    )]
    Stranger {
        /// A folder on the way to the file; `None` for the file itself.
        folder: Option<PathBuf>,
        /// Its owner.
        uid: u32,
        /// Who runs the program.
        own: u32,
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
        let owners = Owners::known();
        owners.judge(None, found.uid())?;
        let here = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = fs::canonicalize(here.unwrap_or(Path::new(".")))?;
        for folder in folder.ancestors() {
            let found = fs::metadata(folder)?;
            judge_folder(folder, found.mode())?;
            owners.judge(Some(folder), found.uid())?;
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

fn folder_of(folder: Option<&Path>) -> String {
    folder.map(|folder| format!("{} ", folder.display())).unwrap_or_default()
}

/// Users whose files are believed: root, who runs the program, and the owner of the program itself, who could
/// change what it does.
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

    fn judge(self, folder: Option<&Path>, uid: u32) -> Result<(), Distrusted> {
        let Self { own, program } = self;
        if [0, own, program].contains(&uid) {
            Ok(())
        } else {
            Err(Distrusted::Stranger { folder: folder.map(Path::to_path_buf), uid, own })
        }
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
    fn hazard_18_files_of_other_users_are_refused() {
        let (folder, root) = (Path::new("/srv"), Owners { own: 0, program: 0 });
        assert_eq!(root.judge(None, 0), Ok(()));
        assert_eq!(
            root.judge(Some(folder), 1_000).unwrap_err().to_string(),
            "/srv belongs to user 1000, must belong to root or to user 0: chown it, or say --insecure"
        );
        let engineer = Owners { own: 1_000, program: 500 };
        assert!([0, 500, 1_000].iter().all(|uid| engineer.judge(None, *uid).is_ok()));
        assert!([1, 501, 1_001, u32::MAX].iter().all(|uid| engineer.judge(None, *uid).is_err()));
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
