//! Signals to commands other than `run`: SIGINT and SIGTERM end one in order; SIGUSR1 and SIGQUIT (Ctrl-\ at a
//! terminal) request a status report. For `run` see [`stop_signals`](crate::stop_signals).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::{io, thread};

use tokio::signal::unix::{Signal, SignalKind, signal};

/// Waits for SIGINT or SIGTERM and returns its name.
pub async fn wait_for_stop() -> &'static str {
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

/// Returns a flag that SIGINT and SIGTERM set, for commands without an async runtime of their own. Starts a thread
/// that receives the signals until the process ends.
pub(super) fn stop_flag() -> io::Result<Arc<AtomicBool>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let registered = runtime.block_on(async {
        let kinds = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()];
        let [interrupt, terminate, hang_up] = kinds.map(signal);
        io::Result::Ok((interrupt?, terminate?, hang_up?))
    });
    let (mut interrupt, mut terminate, hang_up) = registered?;
    let flag = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&flag);
    let receive = async move {
        // SIGHUP is caught and ignored: a closed terminal does not stop the drives.
        let _hang_up = hang_up;
        loop {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
            stop.store(true, Ordering::Relaxed);
        }
    };
    let receive = move || runtime.block_on(receive);
    thread::Builder::new().name("frhc-signals".to_owned()).spawn(receive)?;
    Ok(flag)
}

/// Signals that request a status report, as SIGQUIT does of `ping` and SIGUSR1 of `dd`. Reading the terminal instead
/// would stop a program in the background.
#[derive(Debug)]
pub struct StatusSignals {
    user: Signal,
    quit: Signal,
}

impl StatusSignals {
    /// Replaces the default action, which ends the process. Needs a Tokio runtime.
    ///
    /// # Errors
    /// When a signal handler cannot be installed.
    pub fn install() -> io::Result<Self> {
        Ok(Self { user: signal(SignalKind::user_defined1())?, quit: signal(SignalKind::quit())? })
    }

    /// Waits for the next request.
    pub async fn next(&mut self) {
        tokio::select! {
            _ = self.user.recv() => {}
            _ = self.quit.recv() => {}
        }
    }
}
