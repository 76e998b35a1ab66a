//! Persistent latch: a file that exists while drives may be enabled (ADR 17, 30).
//!
//! It is on disk before the first controlword that enables a drive, and only an orderly end removes it. A node that finds
//! it, or cannot write it, enables no drive before a reset. A reset is refused while the latch cannot be written.
//!
//! All users share its folder. Its name contains the interfaces, which identify the arm.

use std::fmt::Write as _;
use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt, chown};
use std::path::{Path, PathBuf};

use nix::unistd::Group;

use crate::results::{self, Access};
use crate::state;
use node::cause::ResetReason;

/// Group whose members may enable drives.
const GROUP: &str = "frhc";

/// Permissions of a folder created by this program. The setgid bit gives new files the group of the folder.
const FOLDER_PERMISSIONS: u32 = 0o2770;

/// Latch file of one run.
#[derive(Debug)]
pub struct LatchFile {
    folder: PathBuf,
    name: String,
    /// Latch of an earlier release in the user's home, if present.
    earlier: Option<PathBuf>,
    /// This run, as the next one names it: its configuration and its begin.
    run: String,
    /// Reason why the node starts in a stop, if it does.
    awaits: Option<ResetReason>,
    /// That reason as text, which is the content of the latch until a reset succeeds.
    reason: String,
    /// Description of that reason, with the path.
    remark: Option<String>,
}

impl LatchFile {
    /// Creates the latch of the node on these interfaces, or finds it left by the last run. `run` says which run this is.
    pub fn set(interfaces: &[String], run: &str) -> Self {
        Self::set_in(state::latch_folder(), state::earlier_latch_folder(), interfaces, run)
    }

    /// Creates or finds the latch in `folder`, or finds one in the folder `earlier`.
    pub fn set_in(
        folder: PathBuf,
        earlier: Option<PathBuf>,
        interfaces: &[String],
        run: &str,
    ) -> Self {
        let name = name(interfaces);
        // A latch that cannot be inspected counts as present.
        let is_left = |path: &PathBuf| match fs::symlink_metadata(path) {
            Err(error) => ![ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&error.kind()),
            Ok(_) => true,
        };
        let earlier = earlier.map(|folder| folder.join(&name)).filter(is_left);
        let (run, reason) = (run.to_owned(), String::new());
        let latch = Self { folder, name, earlier, run, awaits: None, reason, remark: None };
        let path = latch.path();
        match latch.create() {
            Ok(true) => match latch.earlier.clone() {
                None => latch,
                Some(earlier) => {
                    let latch = latch.left_at(&earlier);
                    latch.restore();
                    latch
                }
            },
            Ok(false) => latch.left_at(&path),
            Err(error) => {
                let reason = format!("the latch could not be written: {error}");
                let remark = format!("{}; {}", latch.failed(&error), latch.remedy());
                latch.awaiting(ResetReason::NoLatch, &reason, &remark)
            }
        }
    }

    /// Awaits a reset because of the latch at `path`, even if it cannot be read.
    fn left_at(self, path: &Path) -> Self {
        let left = fs::read_to_string(path).unwrap_or_else(|error| format!("unreadable: {error}"));
        let left = left.lines().next().unwrap_or("empty").to_owned();
        let remark = format!("{} was left by an earlier run: {left}", path.display());
        self.awaiting(ResetReason::UncleanEnd, &left, &remark)
    }

    fn awaiting(mut self, awaits: ResetReason, reason: &str, remark: &str) -> Self {
        self.awaits = Some(awaits);
        reason.clone_into(&mut self.reason);
        self.remark = Some(format!("no drive is enabled before `frhc ctl reset`: {remark}"));
        self
    }

    /// Returns the reason why the node starts in a stop, if it does.
    pub const fn awaits(&self) -> Option<ResetReason> {
        self.awaits
    }

    /// Returns the description of that stop, with the path.
    pub fn remark(&self) -> Option<&str> {
        self.remark.as_deref()
    }

    /// Takes over the latch for this run, when a reset is requested with the drives off. Retries to create it if that failed
    /// at the start.
    ///
    /// # Errors
    /// When the latch cannot be written; no drive may then be enabled.
    pub fn before_reset(&self) -> Result<(), String> {
        if self.awaits.is_none() {
            return Ok(());
        }
        let written = self.create_folder().and_then(|()| self.write(&self.running_text()));
        written.map_err(|error| format!("{}; {}", self.failed(&error), self.remedy()))
    }

    /// Writes the reason of the stop again, after a reset that has failed with all drives off.
    pub fn restore(&self) {
        if self.awaits.is_none() {
            return;
        }
        if let Err(error) = self.write(&format!("{}\n", self.reason)) {
            tracing::warn!(%error, "the latch keeps another reason than that of its stop");
        }
    }

    /// Clears the stop after a successful reset.
    pub fn release(&mut self) {
        self.awaits = None;
        let Some(path) = self.earlier.take() else { return };
        if let Err(error) = fs::remove_file(&path) {
            tracing::warn!("{}: {error}; the next run waits for a reset", path.display());
        }
    }

    /// Removes the latch after an orderly end, or writes the reason into it. Returns a message to log.
    pub fn end(self, outcome: Result<(), String>) -> Option<String> {
        // Keeps the reason of the earlier run.
        if self.awaits.is_some() {
            return None;
        }
        let path = self.path();
        match outcome {
            Ok(()) => match fs::remove_file(&path).and_then(|()| self.sync()) {
                Ok(()) => None,
                Err(error) if error.kind() == ErrorKind::NotFound => None,
                Err(error) => {
                    Some(format!("{}: {error}; the next run waits for a reset", path.display()))
                }
            },
            Err(reason) => {
                let reason = reason.replace('\n', "; ");
                // It exists with another text otherwise.
                self.write(&format!("{}: {reason}\n", self.run)).ok();
                Some("the next run enables no drive before `frhc ctl reset`".to_owned())
            }
        }
    }

    fn path(&self) -> PathBuf {
        self.folder.join(&self.name)
    }

    /// Creates the file and syncs it to disk. Returns false if it existed.
    fn create(&self) -> io::Result<bool> {
        self.create_folder()?;
        let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(self.path());
        let mut file = match file {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => return Ok(false),
            file => file?,
        };
        // Each member of the group may reset, regardless of the umask.
        file.set_permissions(Access::Group.permissions())?;
        file.write_all(self.running_text().as_bytes())?;
        file.sync_all()?;
        self.sync()?;
        Ok(true)
    }

    /// Replaces the file, which may belong to another user, and syncs it to disk.
    fn write(&self, text: &str) -> io::Result<()> {
        results::replace(&self.path(), text.as_bytes(), Access::Group)
    }

    /// Creates the folder, with the group if this user may set it; does not change an existing folder.
    fn create_folder(&self) -> io::Result<()> {
        if self.folder.is_dir() {
            return Ok(());
        }
        DirBuilder::new().recursive(true).mode(0o700).create(&self.folder)?;
        if let Ok(Some(group)) = Group::from_name(GROUP) {
            // Only root and members of the group may set it. For other users the folder is private.
            chown(&self.folder, None, Some(group.gid.as_raw())).ok();
        }
        fs::set_permissions(&self.folder, Permissions::from_mode(FOLDER_PERMISSIONS))
    }

    /// Syncs the folder.
    fn sync(&self) -> io::Result<()> {
        File::open(&self.folder)?.sync_all()
    }

    /// Content of the latch until the run ends.
    fn running_text(&self) -> String {
        format!("{} did not end in order\n", self.run)
    }

    fn failed(&self, error: &io::Error) -> String {
        format!("the latch {} cannot be written: {error}", self.path().display())
    }

    /// Returns the remedy for a folder that this user cannot write.
    fn remedy(&self) -> String {
        format!(
            "its folder must be writable for users who may enable drives; once, as root: groupadd --system --force {GROUP} && \
             install -d -o root -g {GROUP} -m 2770 {} && usermod -aG {GROUP} USER, then log in again (with simulated drives \
             alone, set STATE_DIRECTORY to another folder)",
            self.folder.display()
        )
    }
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
    use super::*;
    use crate::scratch::path as scratch;

    const RUN: &str = "the run of arm.toml begun 2026-11-28T21:42:13Z";

    fn set(folder: &Path, interface: &str) -> LatchFile {
        LatchFile::set_in(folder.to_path_buf(), None, &[interface.to_owned()], RUN)
    }

    #[test]
    fn hazard_27_only_an_orderly_end_removes_the_latch() {
        let folder = scratch("latch");
        let latch = set(&folder, "can0");
        assert_eq!((latch.awaits(), latch.remark()), (None, None));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o7777;
        let file = folder.join("running-can0");
        assert_eq!((mode(&folder), mode(&file)), (0o2770, 0o660));
        // A crash: `end` is not called.
        drop(latch);
        let latch = set(&folder, "can0");
        let reason = ResetReason::UncleanEnd;
        assert_eq!(latch.awaits(), Some(reason));
        let expected =
            format!("running-can0 was left by an earlier run: {RUN} did not end in order");
        assert!(latch.remark().unwrap().ends_with(&expected), "{:?}", latch.remark());
        assert_eq!(set(&folder, "can1").awaits(), None, "another arm");
        // Ended without a reset: the latch stays.
        assert_eq!(latch.end(Ok(())), None);
        let mut latch = set(&folder, "can0");
        latch.release();
        let ended = latch.end(Err("stopped by joint 3".to_owned()));
        assert!(ended.unwrap().contains("ctl reset"));
        let mut latch = set(&folder, "can0");
        let remark = latch.remark().unwrap();
        assert!(remark.ends_with(&format!("{RUN}: stopped by joint 3")), "{remark}");
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
        latch.before_reset().unwrap();
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
        assert_eq!(latch.awaits(), Some(reason));
        let refused = latch.before_reset().unwrap_err();
        for part in ["running-can0 cannot be written: ", "install -d -o root -g frhc -m 2770 /"] {
            assert!(refused.contains(part) && latch.remark().unwrap().contains(part), "{refused}");
        }
        // The folder has become writable.
        fs::remove_file(&folder).unwrap();
        latch.before_reset().unwrap();
        assert!(folder.join("running-can0").exists());
        // The reset fails.
        latch.restore();
        assert_eq!(latch.end(Ok(())), None);
        let latch = set(&folder, "can0");
        assert!(latch.remark().unwrap().contains("the latch could not be written: "));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_27_failed_reset_keeps_the_reason_of_the_stop() {
        let folder = scratch("latch-failed-reset");
        assert!(set(&folder, "can0").end(Err("stopped by joint 3".to_owned())).is_some());
        let latch = set(&folder, "can0");
        latch.before_reset().unwrap();
        latch.restore();
        assert_eq!(latch.end(Ok(())), None);
        let latch = set(&folder, "can0");
        assert!(latch.remark().unwrap().ends_with("stopped by joint 3"), "{:?}", latch.remark());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_27_unreadable_latch_counts_as_left() {
        let folder = scratch("latch-unreadable");
        fs::create_dir_all(folder.join("running-can0")).unwrap();
        let latch = set(&folder, "can0");
        let reason = ResetReason::UncleanEnd;
        assert_eq!(latch.awaits(), Some(reason));
        assert!(latch.remark().unwrap().contains("unreadable: "), "{:?}", latch.remark());
        assert!(latch.before_reset().is_err(), "it cannot be written either");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_27_latch_of_an_earlier_release_in_the_home_is_found() {
        let (folder, home) = (scratch("latch-shared"), scratch("latch-home"));
        let set =
            || LatchFile::set_in(folder.clone(), Some(home.clone()), &["can0".to_owned()], RUN);
        let latch = set();
        assert_eq!((latch.awaits(), latch.end(Ok(()))), (None, None), "no home, no latch");
        fs::create_dir_all(&home).unwrap();
        fs::write(home.join("running-can0"), "stopped by joint 3\n").unwrap();
        for _ in 0..2 {
            // Another user, without this home, finds it as well once it was found.
            let latch = set();
            let reason = ResetReason::UncleanEnd;
            assert_eq!(latch.awaits(), Some(reason));
            assert!(latch.remark().unwrap().ends_with("stopped by joint 3"));
            assert_eq!(latch.end(Ok(())), None);
            assert!(fs::read_to_string(folder.join("running-can0")).unwrap().contains("joint 3"));
        }
        let mut latch = set();
        latch.before_reset().unwrap();
        latch.release();
        assert!(!home.join("running-can0").exists());
        assert_eq!(latch.end(Ok(())), None);
        assert_eq!(set().awaits(), None);
        [folder, home].iter().for_each(|it| fs::remove_dir_all(it).unwrap());
    }

    #[test]
    fn latch_names_are_safe_file_names() {
        assert_eq!(name(&["can0".to_owned(), "can1".to_owned()]), "running-can0+can1");
        assert_eq!(name(&["a/b c".to_owned()]), "running-a%2Fb%20c");
    }
}
