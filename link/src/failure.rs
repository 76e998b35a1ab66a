//! Failures: an exit code for scripts, those of `frhc`, and one line for people.

use std::fmt::Display;
use std::io::{Write, stderr};
use std::process::ExitCode;

/// A failure.
#[derive(Debug)]
pub struct Failure {
    code: u8,
    text: String,
}

impl Failure {
    /// A setting or a certificate is invalid.
    pub fn configuration(text: impl Display) -> Self {
        Self { code: 3, text: text.to_string() }
    }

    /// A socket, the network or a file failed.
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
