//! Sources of a session: copies of the files that configured its node, and the description of the session.

use std::path::{Path, PathBuf};
use std::{fs, io, thread};

use nix::sys::utsname;
use sha2::{Digest, Sha256};

use crate::provenance::Provenance;
use crate::results;
use config::files::Copies;
use telemetry::manifest::{self, CampaignCase, FileCopy, Host, Manifest, SessionKind};

/// Name of the description in the folder of a session, and of the folder of copies in it.
pub(super) const DESCRIPTION: &str = "session.json";
pub(super) const FILES: &str = "files";

/// Files and command of a recorded session.
#[derive(Clone, Debug)]
pub struct Sources {
    /// Command that records the session.
    pub kind: SessionKind,
    /// Path of the configuration, which `copies` contains.
    pub configuration: PathBuf,
    /// Path of a robot file that replaces the configuration's.
    pub robot: Option<PathBuf>,
    /// Path of the scenario; `None` without a simulation.
    pub scenario: Option<PathBuf>,
    /// Case that a campaign records; `None` for other sessions.
    pub case: Option<CampaignCase>,
    /// Set if the passivity layer of the configuration is disabled.
    pub without_passivity: bool,
    /// Contents of all these files, and of the files that they name.
    pub copies: Copies,
    /// Set to omit host name and folders.
    pub is_anonymous: bool,
}

impl Sources {
    /// Writes the copies and the description into the folder of a session.
    ///
    /// # Errors
    /// When a file cannot be written, or exists.
    pub(super) fn write(&self, folder: &Path, provenance: &Provenance) -> io::Result<()> {
        let copies_folder = folder.join(FILES);
        results::private_folder(&copies_folder)?;
        let mut files = Vec::new();
        for (number, (path, content)) in (1..).zip(&self.copies) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let copy = format!("{FILES}/{number:02}-{name}");
            io::Write::write_all(&mut results::private_file(&folder.join(&copy))?, content)?;
            let sha256 = Sha256::digest(content).iter().map(|byte| format!("{byte:02x}")).collect();
            files.push(FileCopy { path: self.shown(path), copy, sha256 });
        }
        let description = self.description(provenance, files);
        let mut text = serde_json::to_string_pretty(&description)?;
        text.push('\n');
        io::Write::write_all(
            &mut results::private_file(&folder.join(DESCRIPTION))?,
            text.as_bytes(),
        )
    }

    fn description(&self, provenance: &Provenance, files: Vec<FileCopy>) -> Manifest {
        Manifest {
            format: manifest::FORMAT,
            program: format!("frhc {}", env!("CARGO_PKG_VERSION")),
            kind: self.kind,
            origin_us: provenance.origin.as_micros(),
            interfaces: provenance.interfaces.clone(),
            joints: provenance.joint_names().into_iter().map(str::to_owned).collect(),
            configuration: self.shown(&self.configuration),
            robot: self.robot.as_deref().map(|path| self.shown(path)),
            scenario: self.scenario.as_deref().map(|path| self.shown(path)),
            case: self.case,
            without_passivity: self.without_passivity,
            files,
            host: self.host(),
        }
    }

    /// Returns a path as text; in an anonymous session, without the folders common to all files.
    fn shown(&self, path: &Path) -> String {
        let shared = if self.is_anonymous { shared_folder(&self.copies) } else { PathBuf::new() };
        path.strip_prefix(shared).unwrap_or(path).to_string_lossy().into_owned()
    }

    /// Returns facts about this host, without serial numbers.
    fn host(&self) -> Host {
        let system = utsname::uname().ok();
        let text = |of: fn(&utsname::UtsName) -> &std::ffi::OsStr| {
            system.as_ref().map_or_else(String::new, |it| of(it).to_string_lossy().into_owned())
        };
        Host {
            name: (!self.is_anonymous).then(|| text(utsname::UtsName::nodename)),
            kernel: text(utsname::UtsName::release),
            machine: text(utsname::UtsName::machine),
            processor: processor().unwrap_or_default(),
            processors: thread::available_parallelism().map_or(0, usize::from),
        }
    }
}

/// Removes the copies of an earlier session, and their folder if nothing else is in it.
pub(super) fn clear(folder: &Path) -> io::Result<()> {
    results::clear_numbered(&folder.join(FILES), |copy| _ = fs::remove_file(copy))
}

/// Returns the model of the first processor (proc_cpuinfo(5)).
fn processor() -> Option<String> {
    let facts = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = facts.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Returns the deepest folder that contains all files.
fn shared_folder(copies: &Copies) -> PathBuf {
    let mut folders = copies.keys().filter_map(|path| path.parent());
    let Some(first) = folders.next() else { return PathBuf::new() };
    let shared = folders.fold(first.to_path_buf(), |shared, folder| {
        let pairs = shared.components().zip(folder.components());
        pairs.take_while(|(one, other)| one == other).map(|(one, _)| one).collect()
    });
    shared
}

#[cfg(test)]
mod tests {
    use super::*;

    fn copies(paths: &[&str]) -> Copies {
        paths.iter().map(|path| (PathBuf::from(path), path.as_bytes().into())).collect()
    }

    #[test]
    fn shared_folder_is_the_longest_of_all_files() {
        let of = |paths: &[&str]| shared_folder(&copies(paths));
        assert_eq!(
            of(&["/home/a/arm/config/b.toml", "/home/a/arm/eds/c.eds"]),
            Path::new("/home/a/arm")
        );
        assert_eq!(of(&["config/b.toml", "eds/c.eds"]), Path::new(""));
        assert_eq!(of(&["/a/b.toml"]), Path::new("/a"));
        assert_eq!(of(&[]), Path::new(""));
    }
}
