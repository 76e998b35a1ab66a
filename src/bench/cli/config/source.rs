//! Text of a TOML file with its name, and problems at places in it.

use std::ops::Range;
use std::path::PathBuf;

use toml_edit::{Document, TomlError};

use config::Problem;

/// Text of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Source {
    /// Path, for messages.
    pub(super) file: PathBuf,
    pub(super) text: String,
}

impl Source {
    /// Parses the text. The document knows the place of each value.
    ///
    /// # Errors
    /// Returns the first place that is not TOML.
    pub(super) fn parse(&self) -> Result<Document<&str>, Problem> {
        Document::parse(self.text.as_str()).map_err(|error| self.not_toml(&error))
    }

    fn not_toml(&self, error: &TomlError) -> Problem {
        let reason = toml_input::one_line(&self.text, error.message(), error.span());
        self.problem_at(error.span(), &reason)
    }

    /// Returns a problem of the key at a place, or of the file.
    pub(super) fn problem_at(&self, place: Option<Range<usize>>, reason: &str) -> Problem {
        let start = place.map(|place| place.start);
        let key = start.map(|start| toml_input::key_at(&self.text, start)).unwrap_or_default();
        self.problem(start.map(|start| self.line(start)), key, reason)
    }

    /// Returns a problem of a key; of the file if the key is empty.
    pub(super) fn problem(&self, line: Option<usize>, key: String, reason: &str) -> Problem {
        Problem { file: self.file.clone(), line, key, reason: reason.replace('\n', " ") }
    }

    /// Returns the line, from 1, of a byte offset.
    pub(super) fn line(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
    }
}
