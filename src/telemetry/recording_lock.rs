//! Mark of a session that is being recorded: a lock on its description, which the system removes with the process that
//! holds it.

use std::fs::{File, TryLockError};
use std::path::Path;

use config::files;

/// Lock of the process that records a session. Dropping it removes the mark.
#[derive(Debug)]
pub struct RecordingLock {
    _description: File,
}

impl RecordingLock {
    /// Marks the session with this description; `None` where the file cannot be locked.
    pub fn take(description: &Path) -> Option<Self> {
        let file = File::options().write(true).open(description).ok()?;
        file.try_lock().ok()?;
        Some(Self { _description: file })
    }

    /// Returns whether a process records the session with this description; `None` where the file cannot be locked.
    pub fn is_held(description: &Path) -> Option<bool> {
        let file = files::open_unlinked(description).ok()?;
        match file.try_lock_shared() {
            Ok(()) => Some(false),
            Err(TryLockError::WouldBlock) => Some(true),
            Err(TryLockError::Error(_)) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn session_is_marked_while_its_recorder_lives() {
        let file = std::env::temp_dir().join(format!("frhc-{}-mark.json", std::process::id()));
        assert!(RecordingLock::take(&file).is_none());
        assert_eq!(RecordingLock::is_held(&file), None);
        fs::write(&file, "{}").unwrap();
        assert_eq!(RecordingLock::is_held(&file), Some(false));
        let lock = RecordingLock::take(&file).unwrap();
        assert_eq!(RecordingLock::is_held(&file), Some(true));
        drop(lock);
        assert_eq!(RecordingLock::is_held(&file), Some(false));
        fs::remove_file(&file).unwrap();
    }
}
