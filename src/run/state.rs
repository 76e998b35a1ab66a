//! Folders of a node's persistent state: one for the latches of all users, and one for the records of each.

use std::env;
use std::ffi::OsString;
use std::path::PathBuf;

/// Folder of the service's state. Every user who may enable drives writes the latches there.
const SHARED: &str = "/var/lib/frhc";

/// Returns the folder of the latches: `STATE_DIRECTORY`, else `/var/lib/frhc`. It is the same for all users.
pub(super) fn latch_folder() -> PathBuf {
    Variables(env::var_os).latch_folder()
}

/// Returns whether `STATE_DIRECTORY` names the folder of the latches.
pub(super) fn is_named() -> bool {
    Variables(env::var_os).service().is_some()
}

/// Returns the folder in which earlier releases wrote this user's latches, in the home. `None` if no variable is set, or
/// if that folder is `STATE_DIRECTORY`.
pub(super) fn earlier_latch_folder() -> Option<PathBuf> {
    Variables(env::var_os).earlier_latch_folder()
}

/// Returns the folder of this user's records: `STATE_DIRECTORY`, `XDG_STATE_HOME/frhc` or `HOME/.local/state/frhc`; `None`
/// if no variable is set.
pub(super) fn folder() -> Option<PathBuf> {
    Variables(env::var_os).folder()
}

/// Environment variables, by name.
struct Variables<F>(F);

impl<F: Fn(&'static str) -> Option<OsString>> Variables<F> {
    fn latch_folder(&self) -> PathBuf {
        self.service().unwrap_or_else(|| PathBuf::from(SHARED))
    }

    fn earlier_latch_folder(&self) -> Option<PathBuf> {
        if self.service().is_some() { None } else { self.user() }
    }

    fn folder(&self) -> Option<PathBuf> {
        self.service().or_else(|| self.user())
    }

    fn service(&self) -> Option<PathBuf> {
        self.path("STATE_DIRECTORY")
    }

    fn user(&self) -> Option<PathBuf> {
        let xdg = || self.path("XDG_STATE_HOME").map(|folder| folder.join("frhc"));
        xdg().or_else(|| self.path("HOME").map(|folder| folder.join(".local/state/frhc")))
    }

    fn path(&self, name: &'static str) -> Option<PathBuf> {
        let value = (self.0)(name).filter(|value| !value.is_empty())?;
        // systemd separates several folders by colons.
        let first = env::split_paths(&value).next()?;
        // The XDG Base Directory Specification ignores relative paths.
        first.is_absolute().then_some(first)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn hazard_27_latch_folder_is_the_same_for_every_user() {
        for (home, state) in
            [(Some("/home/a"), None), (Some("/root"), Some("/x")), (None, None), (None, Some("x"))]
        {
            let user = Variables(|name| match name {
                "HOME" => home.map(OsString::from),
                "XDG_STATE_HOME" => state.map(OsString::from),
                _ => None,
            });
            assert_eq!(user.latch_folder(), Path::new("/var/lib/frhc"), "{home:?} {state:?}");
        }
        let service = Variables(|name| match name {
            "STATE_DIRECTORY" => Some(OsString::from("/var/lib/frhc:/var/lib/other")),
            "HOME" => Some(OsString::from("/home/frhc")),
            _ => None,
        });
        assert_eq!(service.latch_folder(), Path::new("/var/lib/frhc"));
        assert_eq!(service.folder().unwrap(), Path::new("/var/lib/frhc"));
        assert_eq!(service.earlier_latch_folder(), None);
    }

    #[test]
    fn records_and_earlier_latches_are_in_the_home() {
        let home = Variables(|name| (name == "HOME").then(|| OsString::from("/home/a")));
        let expected = Some(PathBuf::from("/home/a/.local/state/frhc"));
        assert_eq!((home.folder(), home.earlier_latch_folder()), (expected.clone(), expected));
        let nothing = Variables(|_| None);
        assert_eq!((nothing.folder(), nothing.earlier_latch_folder()), (None, None));
    }
}
