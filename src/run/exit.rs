//! How the program ends: one number a script can act on, one line a person can.

use std::fmt;
use std::process::ExitCode;

/// What kind of failure; the numbers are a contract (docs/commands.md, "Exit codes").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A check or comparison is negative.
    Negative,
    /// The command line is wrong.
    Usage,
    /// Configuration, EDS or calibration is invalid; no frame was sent.
    Configuration,
    /// Interface, bus or control socket.
    Bus,
    /// A file that cannot be read or written, stdout included; the same number as [`Bus`](Self::Bus).
    File,
    /// A drive is missing, wrong or refused.
    Drive,
    /// Ended with a latched safety stop.
    Stopped,
    /// Ended by a signal before its time.
    Interrupted,
}

/// What a shell says of a command that Ctrl-C ended.
pub const INTERRUPTED: u8 = 130;

/// A failure and its kind.
#[derive(Debug)]
pub struct Failure {
    kind: Kind,
    error: anyhow::Error,
}

impl Failure {
    /// A failure told in words.
    pub fn new(kind: Kind, message: impl fmt::Display) -> Self {
        Self { kind, error: anyhow::anyhow!("{message}") }
    }

    /// The number of its kind.
    pub fn code(&self) -> ExitCode {
        ExitCode::from(match self.kind {
            Kind::Negative => 1,
            Kind::Usage => 2,
            Kind::Configuration => 3,
            Kind::Bus | Kind::File => 4,
            Kind::Drive => 5,
            Kind::Stopped => 6,
            Kind::Interrupted => INTERRUPTED,
        })
    }
}

/// With all its causes on one line.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#}", self.error)
    }
}

/// Gives an error its kind.
pub trait OrFail<T> {
    /// The value, or the failure of this kind.
    ///
    /// # Errors
    /// The error, as a failure of this kind.
    fn or_fail(self, kind: Kind) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> OrFail<T> for Result<T, E> {
    fn or_fail(self, kind: Kind) -> Result<T, Failure> {
        self.map_err(|error| Failure { kind, error: error.into() })
    }
}
