//! SIGINT and SIGTERM end a run in order; SIGUSR1 and SIGQUIT (Ctrl-\ at a terminal) ask how it is.

use std::io;

use tokio::signal::unix::Signal;
use tokio::signal::unix::SignalKind;
use tokio::signal::unix::signal;

/// Waits for one of them and names it.
pub(super) async fn wait() -> &'static str {
    let interrupt = signal(SignalKind::interrupt());
    let terminate = signal(SignalKind::terminate());
    let (Ok(mut interrupt), Ok(mut terminate)) = (interrupt, terminate) else {
        // Without handlers the signals keep their default action: they end the process.
        return std::future::pending().await;
    };
    tokio::select! {
        _ = interrupt.recv() => "SIGINT",
        _ = terminate.recv() => "SIGTERM",
    }
}

/// Signals that ask a running program to tell of itself, as `ping` does at SIGQUIT and `dd` at SIGUSR1.
/// Reading a terminal instead would stop a program that is put into the background.
#[derive(Debug)]
pub(super) struct Inquiries {
    user: Signal,
    quit: Signal,
}

impl Inquiries {
    /// Takes the signals over from the default action, which ends the process. Within a runtime.
    pub(super) fn heard() -> io::Result<Self> {
        Ok(Self { user: signal(SignalKind::user_defined1())?, quit: signal(SignalKind::quit())? })
    }

    /// Waits for one of them.
    pub(super) async fn next(&mut self) {
        tokio::select! {
            _ = self.user.recv() => {}
            _ = self.quit.recv() => {}
        }
    }
}
