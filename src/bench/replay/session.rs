//! Reader of the folder of a recorded session.

use std::io;
use std::path::{Component, Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::bus_log;
use crate::bus_log_parts::BusLog;
use crate::input_parts::{InputParts, PartError, PartErrorKind};
use crate::part_file::PartFile;
use crate::reader::ReadError;
use crate::replay::Replay;
use crate::source::Source;
use canopen::frame::Telegram;
use config::Config;
use config::files::{self, Copies};
use telemetry::manifest::{FORMAT, FileCopy, Manifest, OLDEST_FORMAT, SessionKind};
use telemetry::parts::{Part, Parts, Stream};
use telemetry::recording::RecordingReport;
use telemetry::recording_lock::RecordingLock;

/// Maximum size of the description, and of a copied file, in bytes.
const MAX_SIZE: u64 = 4 << 20;

/// Files of a session.
const DESCRIPTION: &str = "session.json";
const SUMMARY: &str = "summary.json";

/// Recorded session.
#[derive(Debug)]
pub struct Session {
    folder: PathBuf,
    manifest: Manifest,
    copies: Copies,
    parts: Parts,
    /// As the summary has it; `None` without a summary.
    recording: Option<RecordingReport>,
}

/// Part of a summary that is read here; sessions of an older program lack it.
#[derive(Debug, serde::Deserialize)]
struct Summary {
    recording: Option<RecordingReport>,
}

/// Reasons why a session cannot be used.
#[derive(Debug, Error)]
pub enum SessionError {
    /// Path without a description.
    #[error(
        "{folder}: not a session: it has no session.json; give the folder that --record has written"
    )]
    NotASession { folder: PathBuf },
    /// File that cannot be read.
    #[error("{file}: {error}")]
    Unreadable { file: PathBuf, error: io::Error },
    /// Part of `bus.log` that cannot be read; the error names it.
    #[error(transparent)]
    Log(io::Error),
    /// Invalid description.
    #[error("{file}: {error}")]
    Invalid { file: PathBuf, error: serde_json::Error },
    /// Session of another version.
    #[error("{file}: a session of format {found}; this program reads format {FORMAT}")]
    Version { file: PathBuf, found: u16 },
    /// Copied file with other content than recorded.
    #[error(
        "{file}: not the file that was recorded: its SHA-256 is {found}, and session.json has {recorded}"
    )]
    Edited { file: PathBuf, found: String, recorded: String },
    /// Copy outside the folder of the session.
    #[error("{file}: names \"{copy}\", which is not in the session's folder")]
    Outside { file: PathBuf, copy: String },
    /// Inputs that cannot be read.
    #[error("{file}: {error}")]
    Inputs { file: PathBuf, error: PartErrorKind },
    /// Nothing was recorded.
    #[error("{file}: no call of the node was recorded")]
    Empty { file: PathBuf },
}

impl Session {
    /// Reads the description of a session, and the copied files.
    ///
    /// # Errors
    /// Returns an error if a file is missing, of another version, or not as recorded.
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        let file = folder.join(DESCRIPTION);
        let text = match read(&file) {
            Err(SessionError::Unreadable { error, .. })
                if [io::ErrorKind::NotFound, io::ErrorKind::NotADirectory]
                    .contains(&error.kind()) =>
            {
                return Err(SessionError::NotASession { folder: folder.to_path_buf() });
            }
            text => text?,
        };
        let manifest: Manifest = match serde_json::from_slice(&text) {
            Ok(manifest) => manifest,
            Err(error) => return Err(SessionError::Invalid { file, error }),
        };
        if !(OLDEST_FORMAT..=FORMAT).contains(&manifest.format) {
            return Err(SessionError::Version { file, found: manifest.format });
        }
        let copies = manifest.files.iter().map(|copy| copied(folder, copy));
        let copies = copies.collect::<Result<_, _>>()?;
        let recording = summary(&folder.join(SUMMARY))?;
        let stated = recording.as_ref().map(|recording| recording.parts);
        let parts = Parts::find(folder, stated).map_err(|error| unreadable(folder, error))?;
        Ok(Self { folder: folder.to_path_buf(), manifest, copies, parts, recording })
    }

    /// Returns the folder as it was given to [`open`](Self::open).
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the names of the parts that are missing.
    pub fn missing(&self) -> Vec<String> {
        self.parts.missing()
    }

    /// Returns the gaps of this session, a line each: missing parts, and the reason for an early end. Commands print them and
    /// process the rest.
    pub fn remarks(&self) -> Vec<String> {
        let folder = self.folder.display();
        let missing = self.missing().into_iter();
        let mut remarks: Vec<_> = missing
            .map(|file| format!("{}: is missing", self.folder.join(file).display()))
            .collect();
        match &self.recording {
            None => remarks.push(match RecordingLock::is_held(&self.folder.join(DESCRIPTION)) {
                Some(true) => format!("{folder}: the recording goes on"),
                Some(false) => format!("{folder}: no {SUMMARY}: the recording was killed"),
                None => format!("{folder}: no {SUMMARY}: the recording goes on, or was killed"),
            }),
            Some(RecordingReport { ended_early: Some(reason), .. }) => {
                remarks.push(format!("{folder}: the recording has ended early: {reason}"));
            }
            Some(_) => {}
        }
        remarks
    }

    /// Returns whether the recording has come to the end of its run, by its summary. Its inputs are whole then.
    pub fn is_finished(&self) -> bool {
        matches!(self.recording, Some(RecordingReport { ended_early: None, .. }))
    }

    /// Returns frames and cycles: all parts of `bus.log` that are there, plain or packed, as one log.
    ///
    /// # Errors
    /// Returns an error if no part exists, or the first cannot be read.
    pub fn bus_log(&self) -> Result<BusLog, SessionError> {
        let mut parts = self.log_files().peekable();
        let none = || self.folder.join(Stream::BusLog.part(1));
        let first = parts.peek().cloned().unwrap_or_else(none);
        PartFile::open(&first).map_err(|error| unreadable(&first, error))?;
        BusLog::open(parts).map_err(SessionError::Log)
    }

    /// Checks that each part of `bus.log` that is there is a regular file.
    ///
    /// # Errors
    /// Returns the first that is not, or cannot be opened.
    pub fn check_log(&self) -> Result<(), SessionError> {
        self.log_files().try_for_each(|file| match PartFile::open(&file) {
            Ok(_) => Ok(()),
            Err(error) => Err(unreadable(&file, error)),
        })
    }

    /// Returns the parts of `bus.log` that are there.
    fn log_files(&self) -> impl Iterator<Item = PathBuf> {
        let parts = self.parts.stream(Stream::BusLog).flatten();
        parts.map(|part| self.folder.join(part.name()))
    }

    /// Returns the inputs of the node: all parts in their order, plain or packed, up to the first that is missing.
    ///
    /// # Errors
    /// Returns an error if the first part cannot be read.
    pub fn inputs(&self) -> Result<InputParts, SessionError> {
        let parts = self.parts.stream(Stream::Inputs).map(|part| part.map(Part::name));
        let mut inputs = InputParts::new(&self.folder, parts);
        let Err(PartError { file, kind }) = inputs.begin_first() else { return Ok(inputs) };
        let file = self.folder.join(file);
        Err(match kind {
            PartErrorKind::Missing => match PartFile::open(&file) {
                Err(error) => unreadable(&file, error),
                // It has come since the folder was read.
                Ok(_) => unreadable(&file, io::ErrorKind::NotFound.into()),
            },
            PartErrorKind::Unreadable(ReadError::Failed(error)) => unreadable(&file, error),
            error @ (PartErrorKind::OutOfOrder | PartErrorKind::Unreadable(_)) => {
                SessionError::Inputs { file, error }
            }
        })
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
    /// Returns an error if the inputs cannot be read.
    pub fn replay(&self, config: &Config) -> Result<Replay, SessionError> {
        self.started(config, true)
    }

    /// Starts the node with another configuration than that of the session, without a comparison of frames.
    ///
    /// # Errors
    /// As [`replay`](Self::replay).
    pub fn open_loop(&self, config: &Config) -> Result<Replay, SessionError> {
        self.started(config, false)
    }

    fn started(&self, config: &Config, is_compared: bool) -> Result<Replay, SessionError> {
        let started = Replay::new(config, Source::new(self.inputs()?), is_compared);
        let file = || self.folder.join(Stream::Inputs.part(1));
        started.ok_or_else(|| SessionError::Empty { file: file() })
    }

    /// Returns the frames of a cycle in `bus.log`, in their order. A simulation logs frames when they are complete on the wire,
    /// so frames from the end of a cycle are in the next one.
    ///
    /// # Errors
    /// Returns an error if the log cannot be read.
    pub fn frames_of_cycle(&self, cycle: u64) -> Result<Vec<Telegram>, SessionError> {
        let last = match self.manifest.kind {
            SessionKind::Run => cycle,
            SessionKind::Demo | SessionKind::Campaign => cycle + 1,
        };
        let interfaces = &self.manifest.interfaces;
        let found = bus_log::frames_of_cycles(self.bus_log()?, interfaces, cycle, last);
        found.map_err(SessionError::Log)
    }
}

/// Returns the report on the recording in the summary of a session; `None` without a summary.
fn summary(file: &Path) -> Result<Option<RecordingReport>, SessionError> {
    let text = match read(file) {
        Ok(text) => text,
        Err(SessionError::Unreadable { error, .. }) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(None);
        }
        Err(error) => return Err(error),
    };
    match serde_json::from_slice(&text) {
        Ok(Summary { recording }) => {
            let one_part = RecordingReport { parts: 1, ended_early: None };
            Ok(Some(recording.unwrap_or(one_part)))
        }
        Err(error) => Err(SessionError::Invalid { file: file.to_path_buf(), error }),
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
    let read = files::open_unlinked(file).and_then(|opened| files::at_most(MAX_SIZE, opened));
    read.map_err(|error| unreadable(file, error))
}

fn unreadable(file: &Path, error: io::Error) -> SessionError {
    SessionError::Unreadable { file: file.to_path_buf(), error }
}
