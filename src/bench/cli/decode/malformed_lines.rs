//! Reports of lines that are not candump lines: the first few by number and reason, then their total.

use crate::decode::transcriber::Counts;
use canopen_tools::candump::NotALine;
use run::exit::{Failure, Kind};
use run::print;
use units::wording::counted;

/// Maximum number of lines that are reported individually; a binary file has thousands.
const MAX_REPORTED: u32 = 5;

/// Reports malformed lines of one input.
#[derive(Debug)]
pub(super) struct MalformedLines {
    /// Name of the input, as given.
    input: String,
    is_quiet: bool,
    reported: u32,
}

impl MalformedLines {
    /// Creates the reports of `input`; with `is_quiet` only an input without any valid line is reported.
    pub(super) const fn new(input: String, is_quiet: bool) -> Self {
        Self { input, is_quiet, reported: 0 }
    }

    /// Reports a line, or once that further ones are only counted.
    pub(super) fn line(&mut self, number: u64, error: NotALine) {
        if self.is_quiet || self.reported > MAX_REPORTED {
            return;
        }
        self.reported += 1;
        let input = &self.input;
        if self.reported > MAX_REPORTED {
            print::error(&format!("{input}: further malformed lines are counted, not reported"));
        } else {
            print::error(&format!("{input}:{number}: {error}"));
        }
    }

    /// Prints the total; returns a failure if no line is a candump line.
    pub(super) fn conclude(&self, counts: Counts) -> Result<(), Failure> {
        let Counts { lines, malformed, .. } = counts;
        let input = &self.input;
        if malformed > 0 && malformed == lines {
            let reason = format!("{input}: none of {lines} lines is a candump line");
            return Err(Failure::new(Kind::Negative, reason));
        }
        if malformed > 0 && !self.is_quiet {
            let are =
                if malformed == 1 { "is not a candump line" } else { "are not candump lines" };
            print::note(&format!("{input}: {malformed} of {} {are}", counted(lines, "line")));
        }
        Ok(())
    }
}
