//! Inputs of a session, `inputs.bin` and its further parts. The first failed write ends them, so that they remain
//! readable.

use std::fs::File;
use std::io::{self, BufWriter};

use inputs::{Call, Input, InputWriter};

/// Inputs being written.
#[derive(Debug)]
pub(super) struct InputsFile {
    writer: InputWriter<BufWriter<File>>,
    /// File of the next part, which starts before the next call.
    next: Option<(u32, File)>,
    /// Size of the earlier parts, in bytes.
    finished: u64,
    is_in_cycle: bool,
    /// Set if writing ends once the cycle has returned.
    is_ending: bool,
    has_ended: bool,
    failed: Option<io::Error>,
}

impl InputsFile {
    /// Starts the first part in `file`, which must be empty.
    ///
    /// # Errors
    /// When the header cannot be written.
    pub(super) fn onto(file: File) -> io::Result<Self> {
        let mut writer = InputWriter::begin(BufWriter::new(file))?;
        // A run that is killed at once leaves a file that is one.
        writer.flush()?;
        Ok(Self {
            writer,
            next: None,
            finished: 0,
            is_in_cycle: false,
            is_ending: false,
            has_ended: false,
            failed: None,
        })
    }

    /// Writes an input.
    pub(super) fn write(&mut self, input: &Input) {
        self.begin_next();
        self.end_if_due();
        if self.failed.is_none() && !self.has_ended {
            self.failed = self.writer.write(input).err();
        }
        match input {
            Input::Call(Call::Cycle) => self.is_in_cycle = true,
            // Behind a gap there may be no end of a cycle.
            Input::Returned(_) | Input::Lost(_) => self.is_in_cycle = false,
            Input::Call(_)
            | Input::Intermediates(..)
            | Input::Now(_)
            | Input::Wall(_)
            | Input::Suspended(_)
            | Input::Confirmed(..)
            | Input::NotSent(..)
            | Input::Woken(_)
            | Input::Reopened(_)
            | Input::Sensed(_)
            | Input::SideError(_)
            | Input::Misfits(_)
            | Input::Polled(_) => {}
        }
    }

    /// Continues in the empty `file` of the next part, between two cycles.
    pub(super) fn begin_part(&mut self, number: u32, file: File) {
        self.next = Some((number, file));
        self.begin_next();
    }

    /// Ends writing at the end of this cycle.
    pub(super) fn end(&mut self) {
        self.is_ending = true;
        self.end_if_due();
    }

    fn end_if_due(&mut self) {
        if self.is_ending && !self.is_in_cycle && !self.has_ended {
            self.has_ended = true;
            if self.failed.is_none() {
                self.failed = self.sync().err();
            }
        }
    }

    fn begin_next(&mut self) {
        if self.is_in_cycle || self.failed.is_some() {
            return;
        }
        if let Some((number, file)) = self.next.take() {
            self.failed = self.turn(number, file).err();
        }
    }

    fn turn(&mut self, number: u32, file: File) -> io::Result<()> {
        self.sync()?;
        self.finished += self.writer.written();
        let entries = self.writer.entries();
        self.writer = InputWriter::begin_part(BufWriter::new(file), number, entries)?;
        self.writer.flush()
    }

    /// Syncs this part to the disk.
    fn sync(&mut self) -> io::Result<()> {
        self.writer.flush()?;
        self.writer.get_ref().get_ref().sync_data()
    }

    /// Returns whether the next part is still empty.
    pub(super) const fn is_turning(&self) -> bool {
        self.next.is_some()
    }

    /// Returns the number of bytes written, including earlier parts.
    pub(super) const fn written(&self) -> u64 {
        self.finished + self.writer.written()
    }

    /// Returns the error that ended the inputs.
    pub(super) const fn failure(&self) -> Option<&io::Error> {
        self.failed.as_ref()
    }

    /// Syncs the last part to the disk.
    ///
    /// # Errors
    /// Returns the error of the write that failed.
    pub(super) fn finish(mut self) -> io::Result<()> {
        match self.failed.take() {
            Some(error) => Err(error),
            None => self.sync(),
        }
    }
}
