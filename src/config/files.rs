//! Where configuration text comes from: the disk, or the copies shipped inside the program, so that
//! `frhc demo` runs anywhere.

use std::fs;
use std::io;
use std::io::Read;
use std::path::Component;
use std::path::Path;
use std::path::PathBuf;

use crate::config::problem::Invalid;
use crate::config::problem::Problem;
use crate::config::trust::Guarded;
use crate::config::trust::Trust;

/// The files of `config/` and `eds/`, as they were when the program was built.
const SHIPPED: &[(&str, &[u8])] = &[
    ("config/kraft_like.toml", include_bytes!("../../config/kraft_like.toml")),
    ("config/kraft_like_500hz.toml", include_bytes!("../../config/kraft_like_500hz.toml")),
    ("config/jpl_like.toml", include_bytes!("../../config/jpl_like.toml")),
    ("config/sixr_spherical.toml", include_bytes!("../../config/sixr_spherical.toml")),
    (
        "config/scenarios/teleoperation.toml",
        include_bytes!("../../config/scenarios/teleoperation.toml"),
    ),
    (
        "config/scenarios/contact_10s.toml",
        include_bytes!("../../config/scenarios/contact_10s.toml"),
    ),
    ("config/scenarios/stiff-wall.toml", include_bytes!("../../config/scenarios/stiff-wall.toml")),
    ("config/scenarios/free.toml", include_bytes!("../../config/scenarios/free.toml")),
    ("eds/frhc_drive.eds", include_bytes!("../../eds/frhc_drive.eds")),
    ("eds/frhc_switches.eds", include_bytes!("../../eds/frhc_switches.eds")),
];

/// Files larger than this are not configuration.
const LIMIT: u64 = 4 << 20;

/// The bytes of `path`: of the file on disk if there is one, else of the shipped copy of that name.
///
/// # Errors
/// When there is neither, or the file cannot be read or is larger than 4 MiB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_by(Trust::Any, path)
}

/// The same of a file that must be worth that trust; a shipped copy always is.
///
/// # Errors
/// As [`read`], and when somebody else may write it.
pub fn read_by(trust: Trust, path: &Path) -> io::Result<Vec<u8>> {
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => {
            Err(io::Error::new(io::ErrorKind::IsADirectory, "is a directory"))
        }
        Ok(found) if found.len() > LIMIT => {
            Err(io::Error::new(io::ErrorKind::FileTooLarge, "larger than 4 MiB"))
        }
        Ok(_) => bounded(trust, path),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            shipped(path).map(<[u8]>::to_vec).ok_or(error)
        }
        Err(error) => Err(error),
    }
}

/// A file's bytes, unless they go on beyond the limit, as those of a device may.
fn bounded(trust: Trust, path: &Path) -> io::Result<Vec<u8>> {
    let file = match trust {
        Trust::Any => fs::File::open(path)?,
        Trust::Guarded => guarded(path)?,
    };
    let mut bytes = Vec::new();
    file.take(LIMIT + 1).read_to_end(&mut bytes)?;
    if u64::try_from(bytes.len()).is_ok_and(|length| length <= LIMIT) {
        Ok(bytes)
    } else {
        Err(io::Error::new(io::ErrorKind::FileTooLarge, "larger than 4 MiB"))
    }
}

/// A file that nobody else may write: the one that is open is the one that was looked at.
fn guarded(path: &Path) -> io::Result<fs::File> {
    let found = Guarded::inspect(path)?;
    let file = fs::File::open(path)?;
    found.recognise(&file.metadata()?)?;
    Ok(file)
}

/// The same as text.
///
/// # Errors
/// As [`read_by`], in the words of a configuration.
pub(super) fn text(trust: Trust, file: &Path) -> Result<String, Invalid> {
    let alone = |reason: String| {
        let file = file.to_path_buf();
        Invalid(vec![Problem { file, line: None, key: String::new(), reason }])
    };
    let bytes = read_by(trust, file).map_err(|error| alone(error.to_string()))?;
    String::from_utf8(bytes).map_err(|error| alone(error.to_string()))
}

/// `name` as written in `file`, seen from that file's folder; `..` is resolved in the name alone.
pub fn beside(file: &Path, name: &str) -> PathBuf {
    let mut path = file.parent().unwrap_or(Path::new("")).to_path_buf();
    for part in Path::new(name).components() {
        if part == Component::ParentDir && path.file_name().is_some() {
            path.pop();
        } else if part != Component::CurDir {
            path.push(part);
        }
    }
    path
}

fn shipped(path: &Path) -> Option<&'static [u8]> {
    SHIPPED.iter().find(|(name, _)| Path::new(name) == path).map(|(_, bytes)| *bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_seen_from_the_file_that_says_it() {
        let seen = beside(Path::new("config/kraft_like.toml"), "../eds/frhc_drive.eds");
        assert_eq!(seen, Path::new("eds/frhc_drive.eds"));
        assert_eq!(beside(Path::new("/etc/frhc/a.toml"), "b.eds"), Path::new("/etc/frhc/b.eds"));
    }

    #[test]
    fn what_is_not_there_is_not_found() {
        assert_eq!(
            read(Path::new("config/none.toml")).unwrap_err().kind(),
            io::ErrorKind::NotFound
        );
    }
}
