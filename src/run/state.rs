//! The folder of a node's persistent state: systemd's, else the user's.

use std::env;
use std::path::PathBuf;

/// Returns `STATE_DIRECTORY`, `XDG_STATE_HOME/frhc` or `HOME/.local/state/frhc`; `None` if no variable is set.
pub(super) fn folder() -> Option<PathBuf> {
    let of = |name, below: &str| {
        let value = env::var_os(name).filter(|value| !value.is_empty())?;
        // systemd separates several folders by colons.
        let first = env::split_paths(&value).next()?;
        // The XDG Base Directory Specification ignores relative paths.
        if !first.is_absolute() {
            return None;
        }
        Some(if below.is_empty() { first } else { first.join(below) })
    };
    of("STATE_DIRECTORY", "")
        .or_else(|| of("XDG_STATE_HOME", "frhc"))
        .or_else(|| of("HOME", ".local/state/frhc"))
}
