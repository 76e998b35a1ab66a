//! The folder of a node's state: systemd's, else the user's own.

use std::env;
use std::path::PathBuf;

/// `STATE_DIRECTORY`, `XDG_STATE_HOME/frhc` or `HOME/.local/state/frhc`; `None` if none of them is set.
pub(super) fn folder() -> Option<PathBuf> {
    let of = |name, below: &str| {
        let value = env::var_os(name).filter(|value| !value.is_empty())?;
        // systemd names several folders with colons between them.
        let first = env::split_paths(&value).next()?;
        // The XDG base directories demand that others are ignored.
        if !first.is_absolute() {
            return None;
        }
        Some(if below.is_empty() { first } else { first.join(below) })
    };
    of("STATE_DIRECTORY", "")
        .or_else(|| of("XDG_STATE_HOME", "frhc"))
        .or_else(|| of("HOME", ".local/state/frhc"))
}
