//! The persistent latch: a file that exists while drives may be enabled (ADR 17).
//!
//! It is on disk before the first controlword that enables a drive, and only an orderly end removes it. A node that
//! finds it, or cannot write it, enables no drive before a reset. Its name contains the interfaces, which identify
//! the arm: nodes on other interfaces have other latches.

use std::fmt::Write as _;
use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use crate::state;
use node::cause::{Cause, ResetReason};

/// The latch of one run.
#[derive(Debug)]
pub(super) struct Latch {
    folder: Option<PathBuf>,
    name: String,
    /// Reason why the node starts in a stop, if it does.
    awaits: Option<ResetReason>,
    /// Description of that reason, with the path.
    remark: Option<String>,
}

impl Latch {
    /// Creates the latch of the node on these interfaces, or finds it left by the last run.
    pub(super) fn set(interfaces: &[String]) -> Self {
        Self::set_in(state::folder(), interfaces)
    }

    /// Does the same in `folder`.
    pub(super) fn set_in(folder: Option<PathBuf>, interfaces: &[String]) -> Self {
        let latch = Self { folder, name: name(interfaces), awaits: None, remark: None };
        let Some(path) = latch.path() else {
            let reason = "neither STATE_DIRECTORY nor HOME names a folder for the node's state";
            return latch.awaiting(ResetReason::NoLatch, reason);
        };
        match latch.create() {
            Ok(true) => latch,
            Ok(false) => {
                let left = fs::read_to_string(&path).unwrap_or_default();
                let left = left.lines().next().unwrap_or_default().to_owned();
                let reason = format!("{} is left by an earlier run: {left}", path.display());
                latch.awaiting(ResetReason::UncleanEnd, &reason)
            }
            Err(error) => {
                latch.awaiting(ResetReason::NoLatch, &format!("{}: {error}", path.display()))
            }
        }
    }

    fn awaiting(mut self, awaits: ResetReason, reason: &str) -> Self {
        self.awaits = Some(awaits);
        self.remark = Some(format!("no drive is enabled before `frhc ctl reset`: {reason}"));
        self
    }

    /// Returns the stop in which the node starts, if it does.
    pub(super) fn cause(&self) -> Option<Cause> {
        self.awaits.map(|reason| Cause::AwaitsReset { reason })
    }

    /// Returns the description of that stop, with the path.
    pub(super) fn remark(&self) -> Option<&str> {
        self.remark.as_deref()
    }

    /// Makes the latch that of this run, when a reset is requested with the drives off. Retries one that could not be
    /// created at the start; the reset goes on either way.
    pub(super) fn before_reset(&self) {
        let written = match (self.awaits, self.path()) {
            (None, _) => return,
            (Some(ResetReason::UncleanEnd), Some(path)) => fs::write(path, running_text()),
            (Some(ResetReason::NoLatch), _) | (Some(ResetReason::UncleanEnd), None) => {
                self.create().map(drop)
            }
        };
        if let Err(error) = written {
            tracing::warn!(%error, "cannot write the latch: after a crash the next run will not know of it");
        }
    }

    /// Clears the stop after a successful reset.
    pub(super) const fn release(&mut self) {
        self.awaits = None;
    }

    /// Removes the latch after an orderly end, or writes the reason into it. Returns a message to log.
    pub(super) fn end(self, outcome: Result<(), String>) -> Option<String> {
        let path = self.path()?;
        // Keeps the reason of the earlier run.
        if self.awaits.is_some() {
            return None;
        }
        match outcome {
            Ok(()) => match fs::remove_file(&path).and_then(|()| self.sync()) {
                Ok(()) => None,
                Err(error) if error.kind() == io::ErrorKind::NotFound => None,
                Err(error) => {
                    Some(format!("{}: {error}; the next run waits for a reset", path.display()))
                }
            },
            Err(reason) => {
                let reason = reason.replace('\n', "; ");
                fs::write(&path, format!("{reason}\n")).ok();
                Some("the next run enables no drive before `frhc ctl reset`".to_owned())
            }
        }
    }

    fn path(&self) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join(&self.name))
    }

    /// Creates the file and syncs it to disk. Returns false if it existed.
    fn create(&self) -> io::Result<bool> {
        let path = self.path().ok_or(io::Error::from(io::ErrorKind::NotFound))?;
        if let Some(folder) = &self.folder {
            DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
        }
        let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path);
        let mut file = match file {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(false),
            file => file?,
        };
        file.write_all(running_text().as_bytes())?;
        file.sync_all()?;
        self.sync()?;
        Ok(true)
    }

    /// Syncs the folder.
    fn sync(&self) -> io::Result<()> {
        File::open(self.folder.as_deref().unwrap_or(Path::new(".")))?.sync_all()
    }
}

/// Content of the latch until the run ends.
fn running_text() -> String {
    format!("process {} did not end in order\n", std::process::id())
}

/// Returns the file name, as `running-vcan0+vcan1`. Characters unsafe in file names are percent-encoded.
fn name(interfaces: &[String]) -> String {
    let mut name = String::from("running-");
    for letter in interfaces.join("+").chars() {
        if letter.is_ascii_alphanumeric() || "+-_.".contains(letter) {
            name.push(letter);
        } else {
            write!(name, "%{:02X}", u32::from(letter)).ok();
        }
    }
    name
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::scratch::path as scratch;

    fn set(folder: &Path, interface: &str) -> Latch {
        Latch::set_in(Some(folder.to_path_buf()), &[interface.to_owned()])
    }

    #[test]
    fn hazard_27_only_an_orderly_end_removes_the_latch() {
        let folder = scratch("latch");
        let latch = set(&folder, "can0");
        assert_eq!((latch.cause(), latch.remark()), (None, None));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let file = folder.join("running-can0");
        assert_eq!((mode(&folder), mode(&file)), (0o700, 0o600));
        // A crash: `end` is not called.
        drop(latch);
        let latch = set(&folder, "can0");
        let reason = ResetReason::UncleanEnd;
        assert_eq!(latch.cause(), Some(Cause::AwaitsReset { reason }));
        assert!(latch.remark().unwrap().contains("did not end in order"));
        assert_eq!(set(&folder, "can1").cause(), None, "another arm");
        // Ended without a reset: the latch stays.
        assert_eq!(latch.end(Ok(())), None);
        let mut latch = set(&folder, "can0");
        latch.release();
        let ended = latch.end(Err("stopped by joint 3".to_owned()));
        assert!(ended.unwrap().contains("ctl reset"));
        let mut latch = set(&folder, "can0");
        assert!(latch.remark().unwrap().ends_with("stopped by joint 3"));
        latch.release();
        assert_eq!(latch.end(Ok(())), None);
        assert!(!file.exists());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_27_latch_belongs_to_the_new_run_after_a_reset() {
        let folder = scratch("latch-reset");
        let latch = set(&folder, "can0");
        assert!(latch.end(Err("stopped by joint 3".to_owned())).is_some());
        let mut latch = set(&folder, "can0");
        latch.before_reset();
        assert!(folder.join("running-can0").exists());
        latch.release();
        // A crash.
        drop(latch);
        let latch = set(&folder, "can0");
        assert!(latch.remark().unwrap().ends_with("did not end in order"), "{:?}", latch.remark());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_27_unwritable_latch_awaits_a_reset() {
        let folder = scratch("latch-refused");
        fs::write(&folder, "").unwrap();
        let latch = set(&folder, "can0");
        let reason = ResetReason::NoLatch;
        assert_eq!(latch.cause(), Some(Cause::AwaitsReset { reason }));
        // The folder has become writable.
        fs::remove_file(&folder).unwrap();
        latch.before_reset();
        assert!(folder.join("running-can0").exists());
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(Latch::set_in(None, &[]).cause(), Some(Cause::AwaitsReset { reason }));
    }

    #[test]
    fn latch_names_are_safe_file_names() {
        assert_eq!(name(&["can0".to_owned(), "can1".to_owned()]), "running-can0+can1");
        assert_eq!(name(&["a/b c".to_owned()]), "running-a%2Fb%20c");
    }
}
