//! SIGINT and SIGTERM end a command in order; SIGUSR1 and SIGQUIT (Ctrl-\ at a terminal) request a status report, as SIGQUIT
//! does in `ping` and SIGUSR1 in `dd`. A read from the terminal would stop a program in the background.

use std::io;

use tokio::signal::unix::{Signal, SignalKind, signal};

/// What a signal asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Asked {
    /// An end in order, by the signal of this name.
    End(&'static str),
    /// A status report.
    Report,
}

/// Signals to a command that runs until it is ended.
#[derive(Debug)]
pub(super) struct Signals {
    interrupt: Signal,
    terminate: Signal,
    user: Signal,
    quit: Signal,
}

impl Signals {
    /// Replaces the default action, which ends the process at once. Call it before anything begins that has an end in order.
    /// Needs a Tokio runtime.
    ///
    /// # Errors
    /// Returns an error if a signal handler cannot be installed.
    pub(super) fn install() -> io::Result<Self> {
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            user: signal(SignalKind::user_defined1())?,
            quit: signal(SignalKind::quit())?,
        })
    }

    /// Waits for the next signal.
    pub(super) async fn next(&mut self) -> Asked {
        tokio::select! {
            _ = self.interrupt.recv() => Asked::End("SIGINT"),
            _ = self.terminate.recv() => Asked::End("SIGTERM"),
            _ = self.user.recv() => Asked::Report,
            _ = self.quit.recv() => Asked::Report,
        }
    }
}
