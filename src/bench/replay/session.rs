//! The folder of a recorded session, read again.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Component, Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::bus_log;
use crate::reader::{InputReader, ReadError};
use crate::replay::Replay;
use crate::source::Source;
use canopen::frame::Telegram;
use config::Config;
use config::files::Copies;
use telemetry::manifest::{FORMAT, FileCopy, Manifest, SessionKind};

/// Maximum size of the description, and of a copied file, in bytes.
const MAX_SIZE: u64 = 4 << 20;

/// Files of a session.
const DESCRIPTION: &str = "session.json";
const INPUTS: &str = "inputs.bin";
const BUS_LOG: &str = "bus.log";

/// Flag of open(2): no symbolic link at the end of the path.
const NO_FOLLOW: i32 = 0o400_000;

/// A recorded session.
#[derive(Debug)]
pub struct Session {
    folder: PathBuf,
    manifest: Manifest,
    copies: Copies,
}

/// Reasons why a session cannot be used.
#[derive(Debug, Error)]
pub enum SessionError {
    /// A file cannot be read.
    #[error("{file}: {error}")]
    Unreadable { file: PathBuf, error: io::Error },
    /// The description is invalid.
    #[error("{file}: {error}")]
    Invalid { file: PathBuf, error: serde_json::Error },
    /// The session is of another version.
    #[error("{file}: a session of format {found}; this program reads format {FORMAT}")]
    Version { file: PathBuf, found: u16 },
    /// A copied file has other content than recorded.
    #[error(
        "{file}: not the file that was recorded: its SHA-256 is {found}, and session.json has {recorded}"
    )]
    Edited { file: PathBuf, found: String, recorded: String },
    /// A copy lies outside of the session.
    #[error("{file}: names \"{copy}\", which is not in the session's folder")]
    Outside { file: PathBuf, copy: String },
    /// The inputs cannot be read.
    #[error("{file}: {error}")]
    Inputs { file: PathBuf, error: ReadError },
    /// Nothing was recorded.
    #[error("{file}: no call of the node was recorded")]
    Empty { file: PathBuf },
}

impl Session {
    /// Reads the description of a session, and the files that it copied.
    ///
    /// # Errors
    /// What is missing, of another version, or other than recorded.
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        let file = folder.join(DESCRIPTION);
        let text = read(&file)?;
        let manifest: Manifest = match serde_json::from_slice(&text) {
            Ok(manifest) => manifest,
            Err(error) => return Err(SessionError::Invalid { file, error }),
        };
        if manifest.format != FORMAT {
            return Err(SessionError::Version { file, found: manifest.format });
        }
        let copies = manifest.files.iter().map(|copy| copied(folder, copy));
        let copies = copies.collect::<Result<_, _>>()?;
        Ok(Self { folder: folder.to_path_buf(), manifest, copies })
    }

    /// Returns its description.
    pub const fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Returns the copied files.
    pub const fn copies(&self) -> &Copies {
        &self.copies
    }

    /// Starts the node of the session, with this configuration, on the recorded inputs.
    ///
    /// # Errors
    /// The inputs cannot be read.
    pub fn replay(&self, config: &Config) -> Result<Replay, SessionError> {
        self.started(config, true)
    }

    /// The same without comparing what it sends: with another configuration than that of the session.
    ///
    /// # Errors
    /// As [`replay`](Self::replay).
    pub fn open_loop(&self, config: &Config) -> Result<Replay, SessionError> {
        self.started(config, false)
    }

    fn started(&self, config: &Config, is_compared: bool) -> Result<Replay, SessionError> {
        let file = self.folder.join(INPUTS);
        let opened = open(&file)?;
        let inputs: Box<dyn BufRead> = Box::new(BufReader::new(opened));
        let reader = match InputReader::begin(inputs) {
            Ok(reader) => reader,
            Err(error) => return Err(SessionError::Inputs { file, error }),
        };
        Replay::new(config, Source::new(reader), is_compared).ok_or(SessionError::Empty { file })
    }

    /// Returns the frames of a cycle in `bus.log`, in their order. That of a simulation has frames when they are on the wire,
    /// which those of a cycle's end are in the next.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn frames_of_cycle(&self, cycle: u64) -> Result<Vec<Telegram>, SessionError> {
        let last = match self.manifest.kind {
            SessionKind::Run => cycle,
            SessionKind::Demo | SessionKind::Campaign => cycle + 1,
        };
        let interfaces = &self.manifest.interfaces;
        let found = bus_log::frames_of_cycles(self.bus_log()?, interfaces, cycle, last);
        found.map_err(|error| unreadable(&self.folder.join(BUS_LOG), error))
    }

    /// Opens the log of the buses.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn bus_log(&self) -> Result<impl BufRead + 'static, SessionError> {
        open(&self.folder.join(BUS_LOG)).map(BufReader::new)
    }

    /// Returns its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

/// Returns a copied file with the path that the session has read it by.
fn copied(
    folder: &Path,
    FileCopy { path, copy, sha256 }: &FileCopy,
) -> Result<(PathBuf, std::sync::Arc<[u8]>), SessionError> {
    let is_inside = Path::new(copy).components().all(|part| matches!(part, Component::Normal(_)));
    if !is_inside {
        let file = folder.join(DESCRIPTION);
        return Err(SessionError::Outside { file, copy: copy.clone() });
    }
    let file = folder.join(copy);
    let content = read(&file)?;
    let found: String = Sha256::digest(&content).iter().map(|byte| format!("{byte:02x}")).collect();
    if found != *sha256 {
        return Err(SessionError::Edited { file, found, recorded: sha256.clone() });
    }
    Ok((PathBuf::from(path), content.into()))
}

pub(super) fn read(file: &Path) -> Result<Vec<u8>, SessionError> {
    let mut content = Vec::new();
    let opened = open(file)?;
    match opened.take(MAX_SIZE + 1).read_to_end(&mut content) {
        Ok(length) if u64::try_from(length).is_ok_and(|length| length <= MAX_SIZE) => Ok(content),
        Ok(_) => Err(unreadable(file, io::ErrorKind::FileTooLarge.into())),
        Err(error) => Err(unreadable(file, error)),
    }
}

/// Opens a regular file of a session, never by a symbolic link.
fn open(file: &Path) -> Result<File, SessionError> {
    let opened = fs::symlink_metadata(file).and_then(|found| match found.is_file() {
        true => OpenOptions::new().read(true).custom_flags(NO_FOLLOW).open(file),
        false => Err(io::Error::new(io::ErrorKind::InvalidInput, "must be a regular file")),
    });
    opened.map_err(|error| unreadable(file, error))
}

fn unreadable(file: &Path, error: io::Error) -> SessionError {
    SessionError::Unreadable { file: file.to_path_buf(), error }
}
