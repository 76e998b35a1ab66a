//! The file of inputs of a session, `inputs.bin`. The first failed write ends it: what is there stays readable.

use std::fs::File;
use std::io::{self, BufWriter};

use inputs::{Input, InputWriter};

/// Name in the folder of the session.
pub(super) const NAME: &str = "inputs.bin";

/// File of inputs being written.
#[derive(Debug)]
pub(super) struct InputsFile {
    writer: InputWriter<BufWriter<File>>,
    failed: Option<io::Error>,
}

impl InputsFile {
    /// Begins `file`, which must be empty.
    ///
    /// # Errors
    /// The write fails.
    pub(super) fn onto(file: File) -> io::Result<Self> {
        Ok(Self { writer: InputWriter::begin(BufWriter::new(file))?, failed: None })
    }

    /// Writes an input.
    pub(super) fn write(&mut self, input: &Input) {
        if self.failed.is_none() {
            self.failed = self.writer.write(input).err();
        }
    }

    /// Returns the error that ended the file.
    pub(super) const fn failure(&self) -> Option<&io::Error> {
        self.failed.as_ref()
    }

    /// Flushes the file.
    ///
    /// # Errors
    /// The write that failed.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.failed.map_or_else(|| self.writer.flush(), Err)
    }
}
