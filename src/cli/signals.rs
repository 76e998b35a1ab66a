//! SIGINT and SIGTERM end a run in order, SIGHUP means nothing to it; SIGUSR1 and SIGQUIT (Ctrl-\ at a terminal) ask how it is.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

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

/// What a signal says to a running node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// To stop, in order; said again it means nothing new.
    Stop(&'static str),
    /// What makes other programs read their configuration again. This one never does: a limit that changes
    /// under a hand is a hazard, and a terminal that was closed is no reason to drop an arm.
    HangUp,
}

/// The signals a running node heeds.
#[derive(Debug)]
pub(super) struct Orders {
    interrupt: Signal,
    terminate: Signal,
    hang_up: Signal,
}

impl Orders {
    /// Takes the signals over from the default action, which ends the process at once. Within a runtime.
    pub(super) fn heard() -> io::Result<Self> {
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hang_up: signal(SignalKind::hangup())?,
        })
    }

    /// Waits for the next.
    pub(super) async fn next(&mut self) -> Order {
        tokio::select! {
            _ = self.interrupt.recv() => Order::Stop("SIGINT"),
            _ = self.terminate.recv() => Order::Stop("SIGTERM"),
            _ = self.hang_up.recv() => Order::HangUp,
        }
    }
}

/// Whether a signal has asked to stop since; for what is not served by a runtime anyway. A thread of its
/// own hears them until the process ends.
pub(super) fn stop_asked() -> io::Result<Arc<AtomicBool>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let mut orders = runtime.block_on(async { Orders::heard() })?;
    let asked = Arc::new(AtomicBool::new(false));
    let told = Arc::clone(&asked);
    let hear = async move {
        loop {
            match orders.next().await {
                Order::Stop(_) => told.store(true, Ordering::Relaxed),
                Order::HangUp => {}
            }
        }
    };
    let hear = move || runtime.block_on(hear);
    thread::Builder::new().name("frhc-signals".to_owned()).spawn(hear)?;
    Ok(asked)
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
