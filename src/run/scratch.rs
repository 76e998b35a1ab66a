//! Temporary folders for tests.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::{env, fs, process};

/// Returns the path of a folder that does not exist; every call returns another.
pub(crate) fn path(name: &str) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let path = env::temp_dir().join(format!("frhc-{}-{number}-{name}", process::id()));
    fs::remove_dir_all(&path).ok(); // left by an earlier process with this id
    path
}
