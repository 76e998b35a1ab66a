//! Failures of commands, with exit code and one line of text.

use std::fmt;
use std::process::ExitCode;

use derive_more::Display;

/// Kinds of failure. The exit codes are stable (docs/commands.md, "Exit codes").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A check, comparison or request had a negative result.
    Negative,
    /// The command line is invalid.
    Usage,
    /// Configuration, EDS or calibration is invalid; no frame was sent.
    Configuration,
    /// An interface, bus or control socket failed.
    Bus,
    /// A file, or stdout, cannot be read or written; the same exit code as [`Bus`](Self::Bus).
    File,
    /// The operating system refused a thread or a signal handler; the same exit code as [`Bus`](Self::Bus).
    System,
    /// A drive is missing, has the wrong identity, or failed.
    Drive,
    /// The run ended with a latched safety stop.
    Stopped,
    /// A signal ended the command before it was complete.
    Interrupted,
}

/// Exit code that shells report for a command ended by SIGINT.
pub const INTERRUPTED: u8 = 130;

/// A failure and its kind.
#[derive(Debug, Display)]
#[display("{:#}", self.error)]
pub struct Failure {
    kind: Kind,
    error: anyhow::Error,
}

impl Failure {
    /// Returns a failure with this message.
    pub fn new(kind: Kind, message: impl fmt::Display) -> Self {
        Self { kind, error: anyhow::anyhow!("{message}") }
    }

    /// Returns the exit code of its kind.
    pub fn code(&self) -> ExitCode {
        ExitCode::from(match self.kind {
            Kind::Negative => 1,
            Kind::Usage => 2,
            Kind::Configuration => 3,
            Kind::Bus | Kind::File | Kind::System => 4,
            Kind::Drive => 5,
            Kind::Stopped => 6,
            Kind::Interrupted => INTERRUPTED,
        })
    }
}

/// Conversion of errors to failures.
pub trait OrFail<T> {
    /// Returns the value, or the error as a failure of this kind.
    ///
    /// # Errors
    /// Returns the error as a failure of this kind.
    fn or_fail(self, kind: Kind) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> OrFail<T> for Result<T, E> {
    fn or_fail(self, kind: Kind) -> Result<T, Failure> {
        self.map_err(|error| Failure { kind, error: error.into() })
    }
}
