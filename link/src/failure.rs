//! Failures of the program, with the exit codes of `frhc` and one line of text.

use std::fmt::Display;
use std::io::{Write, stderr};
use std::process::ExitCode;

/// Failure with exit code and text.
#[derive(Debug)]
pub struct Failure {
    code: u8,
    text: String,
}

impl Failure {
    /// Returns the failure of an invalid setting or certificate.
    pub fn configuration(text: impl Display) -> Self {
        Self { code: 3, text: text.to_string() }
    }

    /// Returns the failure of a socket, the network or a file.
    pub fn system(text: impl Display) -> Self {
        Self { code: 4, text: text.to_string() }
    }

    /// Prints the line; returns the exit code.
    pub fn report(&self) -> ExitCode {
        // Standard error may be closed; the exit code says it, too.
        drop(writeln!(stderr(), "frhc-link: {}", self.text));
        ExitCode::from(self.code)
    }

    /// Returns the line.
    #[cfg(test)]
    pub fn text(&self) -> &str {
        &self.text
    }
}
