//! Signals to commands other than `run`: SIGINT and SIGTERM end one in order; SIGUSR1 and SIGQUIT (Ctrl-\ at a
//! terminal) ask how it is. Those to a running node are [`orders`](crate::orders).

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

use tokio::signal::unix::Signal;
use tokio::signal::unix::SignalKind;
use tokio::signal::unix::signal;

/// Waits for one of them and names it.
pub async fn wait() -> &'static str {
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

/// Whether a signal has asked to stop since; for what is not served by a runtime anyway. A thread of its
/// own hears them until the process ends.
pub(super) fn stop_asked() -> io::Result<Arc<AtomicBool>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let listened = runtime.block_on(async {
        let kinds = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()];
        let [interrupt, terminate, hang_up] = kinds.map(signal);
        io::Result::Ok((interrupt?, terminate?, hang_up?))
    });
    let (mut interrupt, mut terminate, hang_up) = listened?;
    let asked = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&asked);
    let hear = async move {
        // A terminal that was closed is no reason to stop.
        let _hang_up = hang_up;
        loop {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
            stop.store(true, Ordering::Relaxed);
        }
    };
    let hear = move || runtime.block_on(hear);
    thread::Builder::new().name("frhc-signals".to_owned()).spawn(hear)?;
    Ok(asked)
}

/// Signals that ask a running program to tell of itself, as `ping` does at SIGQUIT and `dd` at SIGUSR1.
/// Reading a terminal instead would stop a program that is put into the background.
#[derive(Debug)]
pub struct Inquiries {
    user: Signal,
    quit: Signal,
}

impl Inquiries {
    /// Takes the signals over from the default action, which ends the process. Within a runtime.
    ///
    /// # Errors
    /// When the process may not.
    pub fn heard() -> io::Result<Self> {
        Ok(Self { user: signal(SignalKind::user_defined1())?, quit: signal(SignalKind::quit())? })
    }

    /// Waits for one of them.
    pub async fn next(&mut self) {
        tokio::select! {
            _ = self.user.recv() => {}
            _ = self.quit.recv() => {}
        }
    }
}
