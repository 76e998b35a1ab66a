//! SIGINT and SIGTERM end a command in order; SIGUSR1 and SIGQUIT (Ctrl-\ at a terminal) request a status report.

use std::io;

use tokio::signal::unix::{Signal, SignalKind, signal};

/// Waits for SIGINT or SIGTERM and returns its name.
pub(super) async fn wait_for_stop() -> &'static str {
    let interrupt = signal(SignalKind::interrupt());
    let terminate = signal(SignalKind::terminate());
    let (Ok(mut interrupt), Ok(mut terminate)) = (interrupt, terminate) else {
        // Without handlers the signals keep their default action and end the process.
        return std::future::pending().await;
    };
    tokio::select! {
        _ = interrupt.recv() => "SIGINT",
        _ = terminate.recv() => "SIGTERM",
    }
}

/// Signals that request a status report, as SIGQUIT in `ping` and SIGUSR1 in `dd`. A read from the terminal would stop a
/// program in the background.
#[derive(Debug)]
pub(super) struct StatusSignals {
    user: Signal,
    quit: Signal,
}

impl StatusSignals {
    /// Replaces the default action, which ends the process. Needs a Tokio runtime.
    ///
    /// # Errors
    /// Returns an error if a signal handler cannot be installed.
    pub(super) fn install() -> io::Result<Self> {
        Ok(Self { user: signal(SignalKind::user_defined1())?, quit: signal(SignalKind::quit())? })
    }

    /// Waits for the next request.
    pub(super) async fn next(&mut self) {
        tokio::select! {
            _ = self.user.recv() => {}
            _ = self.quit.recv() => {}
        }
    }
}
