//! All parts of a session's inputs, read in their order.

use std::collections::VecDeque;
use std::fmt;
use std::io::BufRead;
use std::path::{Path, PathBuf};

use crate::part_file::PartFile;
use crate::reader::{InputReader, ReadError};
use inputs::Input;

/// Size of the header of a part, in bytes.
const HEADER: u64 = 20;

/// Inputs of a session, part by part. They end where a part is missing, cut, or not the one that follows.
#[derive(Debug)]
pub struct InputParts {
    folder: PathBuf,
    /// Parts that are still to be read: the file of each, or the name of a missing one.
    rest: VecDeque<Result<String, String>>,
    current: Option<Current>,
    /// Number of opened parts.
    begun: u32,
    entries: u64,
}

/// Part that is read.
#[derive(Debug)]
struct Current {
    /// Name of its file.
    file: String,
    is_packed: bool,
    reader: InputReader<Box<dyn BufRead>>,
}

/// File in which the inputs end early.
#[derive(Debug)]
pub struct PartError {
    /// Name of the file in the folder of the session.
    pub file: String,
    /// Reason for the early end.
    pub kind: PartErrorKind,
}

/// Reason for an early end of the inputs.
#[derive(Debug)]
pub enum PartErrorKind {
    /// Missing file.
    Missing,
    /// File that begins as another part, or behind other entries, than those that were read.
    OutOfOrder,
    /// File that cannot be read.
    Unreadable(ReadError),
}

impl fmt::Display for PartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file, self.kind)
    }
}

impl fmt::Display for PartErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("is missing"),
            Self::OutOfOrder => {
                f.write_str("not the part that follows: inputs before it are missing")
            }
            Self::Unreadable(error) => write!(f, "{error}"),
        }
    }
}

impl InputParts {
    /// Returns the inputs of these parts in `folder`.
    pub(super) fn new(
        folder: &Path,
        parts: impl IntoIterator<Item = Result<String, String>>,
    ) -> Self {
        Self {
            folder: folder.to_path_buf(),
            rest: parts.into_iter().collect(),
            current: None,
            begun: 0,
            entries: 0,
        }
    }

    /// Returns inputs that are no file.
    ///
    /// # Errors
    /// Returns an error if the file has no inputs, or those of another version.
    pub(super) fn of_one(inputs: impl BufRead + 'static) -> Result<Self, ReadError> {
        let inputs: Box<dyn BufRead> = Box::new(inputs);
        let reader = InputReader::begin(inputs)?;
        let current = Current { file: "inputs".to_owned(), is_packed: false, reader };
        Ok(Self { current: Some(current), ..Self::new(Path::new(""), []) })
    }

    /// Reads the next input; `None` at the end of the last part.
    ///
    /// # Errors
    /// Returns an error if a part is missing, unreadable or cut, or is not the one that follows.
    pub fn read(&mut self) -> Result<Option<Input>, PartError> {
        loop {
            if let Some(Current { file, reader, .. }) = &mut self.current {
                match reader.read() {
                    Ok(Some(input)) => {
                        self.entries = reader.entries();
                        return Ok(Some(input));
                    }
                    Ok(None) => self.current = None,
                    Err(error) => {
                        let file = file.clone();
                        return Err(PartError { file, kind: PartErrorKind::Unreadable(error) });
                    }
                }
            }
            let Some(next) = self.rest.pop_front() else { return Ok(None) };
            self.begin(next)?;
        }
    }

    /// Returns whether an error is the end of a recording that was cut while its last part was written. All earlier
    /// entries are valid then.
    pub(super) fn is_cut(&self, error: &PartError) -> bool {
        let is_plain = self.current.as_ref().is_some_and(|current| !current.is_packed);
        let is_cut = matches!(error.kind, PartErrorKind::Unreadable(ReadError::Cut(_)));
        is_cut && is_plain && self.rest.is_empty()
    }

    /// Opens the first part, so that an invalid one is reported immediately.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub(super) fn begin_first(&mut self) -> Result<(), PartError> {
        let next = self.rest.pop_front();
        next.map_or(Ok(()), |next| self.begin(next))
    }

    fn begin(&mut self, part: Result<String, String>) -> Result<(), PartError> {
        self.begun += 1;
        let file = match part {
            Ok(file) => file,
            Err(file) => return Err(PartError { file, kind: PartErrorKind::Missing }),
        };
        let opened = PartFile::open(&self.folder.join(&file)).map_err(ReadError::Failed);
        let begun = opened.and_then(|opened| {
            let is_packed = opened.is_packed();
            let opened: Box<dyn BufRead> = Box::new(opened);
            Ok((is_packed, InputReader::begin(opened)?))
        });
        match begun {
            // A run that was killed before it has written to its newest part.
            Err(ReadError::Foreign | ReadError::Cut(_)) if self.is_begun_last(&file) => Ok(()),
            Err(error) => Err(PartError { file, kind: PartErrorKind::Unreadable(error) }),
            Ok((_, reader)) if (reader.part(), reader.entries()) != (self.begun, self.entries) => {
                Err(PartError { file, kind: PartErrorKind::OutOfOrder })
            }
            Ok((is_packed, reader)) => {
                self.current = Some(Current { file, is_packed, reader });
                Ok(())
            }
        }
    }

    /// Returns whether a further part is the last one, and has less than its header.
    fn is_begun_last(&self, file: &str) -> bool {
        let size = self.folder.join(file).symlink_metadata().map_or(u64::MAX, |found| found.len());
        self.begun > 1 && self.rest.is_empty() && size < HEADER
    }
}
