//! A file that is replaced in one step, while its old content stays beside it under a number.

use std::fs::{self, FileTimes, Metadata, OpenOptions, Permissions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use config::files;
use run::results::{self, Access};

/// Maximum size, in bytes: that of a configuration.
pub(super) const MAX_SIZE: u64 = 4 << 20;

/// Maximum number of attempts at a name that other processes take meanwhile.
const MAX_ATTEMPTS: u32 = 100;

/// Bits of a mode that `chmod` sets.
const PERMISSIONS: u32 = 0o7777;

/// A file as it was read.
#[derive(Debug)]
pub(super) struct Original {
    /// File itself: the target of a symbolic link.
    path: PathBuf,
    content: Vec<u8>,
}

impl Original {
    /// Reads a regular file. A shipped one need not be on disk, but cannot be replaced then.
    ///
    /// # Errors
    /// When the file is not regular, cannot be read, or is larger than a configuration may be.
    pub(super) fn read(path: &Path) -> io::Result<Self> {
        let content = files::read(path)?;
        let is_link = fs::symlink_metadata(path).is_ok_and(|found| found.is_symlink());
        let path = if is_link { fs::canonicalize(path)? } else { path.to_path_buf() };
        Ok(Self { path, content })
    }

    pub(super) fn content(&self) -> &[u8] {
        &self.content
    }

    /// Path of the file itself.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns whether `other` is this file, by whatever name.
    pub(super) fn is(&self, other: &Path) -> bool {
        let identity =
            |path: &Path| fs::metadata(path).map(|found| (found.dev(), found.ino())).ok();
        let own = identity(&self.path);
        own.is_some() && own == identity(other)
    }

    /// Returns an error if the file may not be written. Renaming would replace a write-protected file, too.
    ///
    /// # Errors
    /// When no one, or not this user, may write the file.
    pub(super) fn ensure_writable(&self) -> io::Result<()> {
        let found = match fs::metadata(&self.path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let reason =
                    "is not on disk, only in the program: copy it from the repository first";
                return Err(io::Error::new(ErrorKind::NotFound, reason));
            }
            found => found?,
        };
        let mode = found.mode() & PERMISSIONS;
        if mode & 0o222 == 0 {
            let reason = format!("is write-protected (mode {mode:04o}): chmod u+w it first");
            return Err(io::Error::new(ErrorKind::PermissionDenied, reason));
        }
        OpenOptions::new().write(true).open(&self.path).map(drop)
    }

    /// Replaces the file by `content`, with its owner and permissions. Returns the path of the copy of the old file.
    ///
    /// # Errors
    /// When the file was changed since it was read, or a file cannot be written. The file is then as it was, without a copy.
    pub(super) fn replace(&self, content: &[u8]) -> io::Result<PathBuf> {
        self.ensure_writable()?;
        let as_before = fs::metadata(&self.path)?;
        let new = self.prepare(content, &as_before)?;
        let old = self.prepare(&self.content, &as_before)?;
        let times = FileTimes::new().set_modified(as_before.modified()?);
        old.as_file().set_times(times)?;
        if files::at_most(MAX_SIZE, files::open(&self.path)?)? != self.content {
            let reason = "was changed meanwhile: run the command again";
            return Err(io::Error::new(ErrorKind::InvalidData, reason));
        }
        let kept = self.keep(old)?;
        let renamed = results::sync_folder(&self.path)
            .and_then(|()| new.persist(&self.path).map_err(|error| error.error));
        match renamed {
            Ok(_) => results::sync_folder(&self.path).map(|()| kept),
            Err(error) => {
                fs::remove_file(&kept).ok();
                Err(error)
            }
        }
    }

    /// Writes and syncs a temporary file beside this one, with the owner and the permissions of this one.
    fn prepare(&self, content: &[u8], like: &Metadata) -> io::Result<NamedTempFile> {
        let mut file = results::beside(&self.path, Access::Owner)?;
        file.write_all(content)?;
        let own = file.as_file().metadata()?;
        if (own.uid(), own.gid()) != (like.uid(), like.gid()) {
            fchown(file.as_file(), Some(like.uid()), Some(like.gid())).map_err(|error| {
                let (uid, gid) = (like.uid(), like.gid());
                let reason = format!("cannot keep its owner {uid} and group {gid}: {error}");
                io::Error::new(error.kind(), reason)
            })?;
        }
        // After the owner, whose change clears bits of the mode.
        let mode = Permissions::from_mode(like.mode() & PERMISSIONS);
        file.as_file().set_permissions(mode)?;
        file.as_file().sync_all()?;
        Ok(file)
    }

    /// Names the copy of the old file `MY.toml.N`, with the number after the highest one there is.
    fn keep(&self, mut old: NamedTempFile) -> io::Result<PathBuf> {
        for _ in 0..MAX_ATTEMPTS {
            let path = self.next_free()?;
            match old.persist_noclobber(&path) {
                Ok(_) => return Ok(path),
                Err(error) if error.error.kind() == ErrorKind::AlreadyExists => old = error.file,
                Err(error) => return Err(error.error),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    fn next_free(&self) -> io::Result<PathBuf> {
        let Some(name) = self.path.file_name() else { return Err(ErrorKind::InvalidInput.into()) };
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let mut last = 0;
        for entry in fs::read_dir(folder.unwrap_or(Path::new(".")))? {
            let found = entry?.file_name();
            let rest = found.as_encoded_bytes().strip_prefix(name.as_encoded_bytes());
            let number = rest.and_then(|rest| std::str::from_utf8(rest.strip_prefix(b".")?).ok());
            last =
                number.and_then(|number| number.parse().ok()).map_or(last, |it: u64| last.max(it));
        }
        let mut numbered = name.to_owned();
        numbered.push(format!(".{}", last.saturating_add(1)));
        Ok(self.path.with_file_name(numbered))
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn folder() -> tempfile::TempDir {
        tempfile::tempdir().unwrap()
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn old_files_are_kept_under_rising_numbers() {
        let folder = folder();
        let path = folder.path().join("my.toml");
        fs::write(&path, "one").unwrap();
        for (content, kept) in [("two", "my.toml.1"), ("three", "my.toml.2")] {
            let before = fs::read(&path).unwrap();
            let kept = folder.path().join(kept);
            let original = Original::read(&path).unwrap();
            assert_eq!(original.replace(content.as_bytes()).unwrap(), kept);
            assert_eq!(
                (fs::read(&path).unwrap(), fs::read(kept).unwrap()),
                (content.into(), before)
            );
        }
        fs::write(folder.path().join("my.toml.41"), "mine").unwrap();
        let original = Original::read(&path).unwrap();
        assert_eq!(original.replace(b"four").unwrap(), folder.path().join("my.toml.42"));
        assert_eq!(
            names(folder.path()),
            ["my.toml", "my.toml.1", "my.toml.2", "my.toml.41", "my.toml.42"]
        );
    }

    #[test]
    fn permissions_and_time_of_the_old_file_are_kept() {
        let folder = folder();
        let path = folder.path().join("my.toml");
        fs::write(&path, "one").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        let before = fs::metadata(&path).unwrap();
        let kept = Original::read(&path).unwrap().replace(b"two").unwrap();
        let [new, old] = [&path, &kept].map(|path| fs::metadata(path).unwrap());
        assert_eq!((new.mode(), old.mode()), (before.mode(), before.mode()));
        assert_eq!((new.uid(), new.gid()), (before.uid(), before.gid()));
        assert_eq!(old.modified().unwrap(), before.modified().unwrap());
    }

    #[test]
    fn target_of_a_symbolic_link_is_replaced_and_kept() {
        let folder = folder();
        let (there, link) = (folder.path().join("there"), folder.path().join("my.toml"));
        fs::create_dir(&there).unwrap();
        let target = there.join("real.toml");
        fs::write(&target, "one").unwrap();
        symlink("there/real.toml", &link).unwrap();
        let original = Original::read(&link).unwrap();
        assert!(original.is(&target) && !original.is(&there));
        original.replace(b"two").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&link).unwrap(), b"two");
        assert_eq!(names(&there), ["real.toml", "real.toml.1"]);
        assert_eq!(names(folder.path()), ["my.toml", "there"]);
    }

    #[test]
    fn file_that_is_protected_or_was_changed_is_left_alone() {
        let folder = folder();
        let path = folder.path().join("my.toml");
        fs::write(&path, "one").unwrap();
        let original = Original::read(&path).unwrap();
        fs::write(&path, "other").unwrap();
        let changed = original.replace(b"two").unwrap_err().to_string();
        assert_eq!(changed, "was changed meanwhile: run the command again");
        fs::set_permissions(&path, Permissions::from_mode(0o444)).unwrap();
        let protected = Original::read(&path).unwrap().replace(b"two").unwrap_err().to_string();
        assert_eq!(protected, "is write-protected (mode 0444): chmod u+w it first");
        assert_eq!(fs::read(&path).unwrap(), b"other");
        assert_eq!(names(folder.path()), ["my.toml"]);
    }
}
