//! Failures of commands, with exit code and one line of text.

use std::fmt;
use std::process::ExitCode;

use derive_more::Display;

/// Kinds of failure. The exit codes are stable (docs/commands.md, "Exit codes").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Negative result of a check, comparison or request: exit code 1.
    Negative,
    /// Invalid command line: 2.
    Usage,
    /// Invalid configuration, EDS or calibration; no frame was sent: 3.
    Configuration,
    /// Failure of an interface, bus or control socket: 4.
    Bus,
    /// Failure to read or write a file, or stdout: 4, as for [`Bus`](Self::Bus).
    File,
    /// Thread or signal handler that the operating system refused: 4, as for [`Bus`](Self::Bus).
    System,
    /// Drive that is missing, has the wrong identity, or failed: 5.
    Drive,
    /// Run that ended with a latched safety stop: 6.
    Stopped,
    /// Command that a signal ended before it was complete: [`INTERRUPTED`].
    Interrupted,
}

/// Exit code that shells report for a command ended by SIGINT.
pub const INTERRUPTED: u8 = 130;

/// Error that ends a command, with the kind that decides the exit code.
#[derive(Debug, Display)]
#[display("{:#}", self.error)]
pub struct Failure {
    kind: Kind,
    error: anyhow::Error,
}

impl Failure {
    /// Returns a failure without further causes.
    pub fn new(kind: Kind, message: impl fmt::Display) -> Self {
        Self { kind, error: anyhow::anyhow!("{message}") }
    }

    /// Returns the exit code of the kind.
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
