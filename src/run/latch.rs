//! A latch that outlives the process: a file that is there while drives may be enabled (ADR 17).
//!
//! It is on the disk before the first word that enables a drive, and is removed by an orderly end alone. A node that
//! finds it, or cannot write it, enables nothing before a reset. It belongs to the interfaces, because these lead to
//! the arm: two nodes on other interfaces have other files.

use std::fmt::Write as _;
use std::fs;
use std::fs::DirBuilder;
use std::fs::File;
use std::fs::OpenOptions;
use std::io;
use std::io::Write;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::path::PathBuf;

use crate::state;
use node::cause::Awaited;
use node::cause::Cause;

/// The latch of one run.
#[derive(Debug)]
pub(super) struct Latch {
    folder: Option<PathBuf>,
    name: String,
    /// Reason why the node begins stopped.
    awaits: Option<Awaited>,
    /// The same in words, with the place.
    remark: Option<String>,
}

impl Latch {
    /// Sets the latch of the node on these interfaces, unless the last run has left it.
    pub(super) fn set(interfaces: &[String]) -> Self {
        Self::set_in(state::folder(), interfaces)
    }

    /// The same in this folder.
    pub(super) fn set_in(folder: Option<PathBuf>, interfaces: &[String]) -> Self {
        let latch = Self { folder, name: name(interfaces), awaits: None, remark: None };
        let Some(path) = latch.path() else {
            let reason = "neither STATE_DIRECTORY nor HOME names a folder for the node's state";
            return latch.awaiting(Awaited::Unmarked, reason);
        };
        match latch.mark() {
            Ok(true) => latch,
            Ok(false) => {
                let left = fs::read_to_string(&path).unwrap_or_default();
                let left = left.lines().next().unwrap_or_default().to_owned();
                let reason = format!("{} is left of a run: {left}", path.display());
                latch.awaiting(Awaited::NotEnded, &reason)
            }
            Err(error) => {
                latch.awaiting(Awaited::Unmarked, &format!("{}: {error}", path.display()))
            }
        }
    }

    fn awaiting(mut self, awaits: Awaited, reason: &str) -> Self {
        self.awaits = Some(awaits);
        self.remark = Some(format!("nothing is enabled before `frhc ctl reset`: {reason}"));
        self
    }

    /// The stop in which the node begins.
    pub(super) fn cause(&self) -> Option<Cause> {
        self.awaits.map(|awaited| Cause::AwaitsReset { awaited })
    }

    /// That reason in words, with the place.
    pub(super) fn remark(&self) -> Option<&str> {
        self.remark.as_deref()
    }

    /// A reset is asked for, with the drives off: the latch is that of this run from now on. One that could not be set
    /// at the start is tried again; the reset goes on either way.
    pub(super) fn before_reset(&self) {
        let marked = match (self.awaits, self.path()) {
            (None, _) => return,
            (Some(Awaited::NotEnded), Some(path)) => fs::write(path, unended()),
            (Some(Awaited::Unmarked), _) | (Some(Awaited::NotEnded), None) => self.mark().map(drop),
        };
        if let Err(error) = marked {
            tracing::warn!(%error, "a crash of this run will leave no trace of its own");
        }
    }

    /// A reset has succeeded.
    pub(super) const fn release(&mut self) {
        self.awaits = None;
    }

    /// The run has ended: the latch goes if that was in order, and keeps the reason if not. Returns what to log.
    pub(super) fn end(self, outcome: Result<(), String>) -> Option<String> {
        let path = self.path()?;
        // What was left before is not known better now.
        if self.awaits.is_some() {
            return None;
        }
        match outcome {
            Ok(()) => match fs::remove_file(&path).and_then(|()| self.sync()) {
                Ok(()) => None,
                Err(error) if error.kind() == io::ErrorKind::NotFound => None,
                Err(error) => {
                    Some(format!("{}: {error}: the next run waits for a reset", path.display()))
                }
            },
            Err(reason) => {
                let reason = reason.replace('\n', "; ");
                fs::write(&path, format!("{reason}\n")).ok();
                Some("the next run enables nothing before `frhc ctl reset`".to_owned())
            }
        }
    }

    fn path(&self) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join(&self.name))
    }

    /// Creates the file, so that it would survive a loss of power. Returns whether it was not there before.
    fn mark(&self) -> io::Result<bool> {
        let path = self.path().ok_or(io::Error::from(io::ErrorKind::NotFound))?;
        if let Some(folder) = &self.folder {
            DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
        }
        let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path);
        let mut file = match file {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(false),
            file => file?,
        };
        file.write_all(unended().as_bytes())?;
        file.sync_all()?;
        self.sync()?;
        Ok(true)
    }

    /// Makes the folder's entries durable.
    fn sync(&self) -> io::Result<()> {
        File::open(self.folder.as_deref().unwrap_or(Path::new(".")))?.sync_all()
    }
}

/// Content of a latch until the run ends.
fn unended() -> String {
    format!("process {} did not end in order\n", std::process::id())
}

/// `running-vcan0+vcan1`; what no file's name should have is written as a number.
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
    fn hazard_27_latch_is_released_by_an_orderly_end_alone() {
        let folder = scratch("latch");
        let latch = set(&folder, "can0");
        assert_eq!((latch.cause(), latch.remark()), (None, None));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let file = folder.join("running-can0");
        assert_eq!((mode(&folder), mode(&file)), (0o700, 0o600));
        // It crashes: nothing is said of its end.
        drop(latch);
        let latch = set(&folder, "can0");
        let awaited = Awaited::NotEnded;
        assert_eq!(latch.cause(), Some(Cause::AwaitsReset { awaited }));
        assert!(latch.remark().unwrap().contains("did not end in order"));
        assert_eq!(set(&folder, "can1").cause(), None, "another arm");
        // Ended before it was reset: it still waits.
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
    fn hazard_27_latch_after_a_reset_is_that_of_the_new_run() {
        let folder = scratch("latch-reset");
        let latch = set(&folder, "can0");
        assert!(latch.end(Err("stopped by joint 3".to_owned())).is_some());
        let mut latch = set(&folder, "can0");
        latch.before_reset();
        assert!(folder.join("running-can0").exists());
        latch.release();
        // It crashes.
        drop(latch);
        let latch = set(&folder, "can0");
        assert!(latch.remark().unwrap().ends_with("did not end in order"), "{:?}", latch.remark());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_27_latch_that_cannot_be_set_awaits_a_reset() {
        let folder = scratch("latch-refused");
        fs::write(&folder, "").unwrap();
        let latch = set(&folder, "can0");
        let awaited = Awaited::Unmarked;
        assert_eq!(latch.cause(), Some(Cause::AwaitsReset { awaited }));
        // By then it can be written.
        fs::remove_file(&folder).unwrap();
        latch.before_reset();
        assert!(folder.join("running-can0").exists());
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(Latch::set_in(None, &[]).cause(), Some(Cause::AwaitsReset { awaited }));
    }

    #[test]
    fn names_of_latches_are_names_of_files() {
        assert_eq!(name(&["can0".to_owned(), "can1".to_owned()]), "running-can0+can1");
        assert_eq!(name(&["a/b c".to_owned()]), "running-a%2Fb%20c");
    }
}
