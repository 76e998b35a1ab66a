//! Ctrl-C for a command that leaves files: it ends them whole. A second one ends the process at once.

use std::io;
use std::process;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

use tokio::signal::unix::Signal;
use tokio::signal::unix::SignalKind;
use tokio::signal::unix::signal;

use run::exit::INTERRUPTED;

/// A file has met its limit of size; so numbered by Linux on every architecture but MIPS.
const SIGXFSZ: i32 = 25;

/// Set by the first SIGINT or SIGTERM.
#[derive(Clone, Debug, Default)]
pub(super) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Takes both signals over from their default action, and SIGXFSZ too: a limit of size is then an error of the
    /// write that meets it.
    pub(super) fn watch() -> io::Result<Self> {
        let interrupt = Self::default();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let guard = runtime.enter();
        let signals = Signals {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            size: signal(SignalKind::from_raw(SIGXFSZ))?,
        };
        drop(guard);
        let watched = interrupt.clone();
        let thread = thread::Builder::new().name("frhc-signals".to_owned());
        thread.spawn(move || runtime.block_on(watched.serve(signals)))?;
        Ok(interrupt)
    }

    /// Returns whether a signal came.
    pub(super) fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    async fn serve(self, mut signals: Signals) {
        loop {
            tokio::select! {
                _ = signals.interrupt.recv() => self.set(),
                _ = signals.terminate.recv() => self.set(),
                _ = signals.size.recv() => {}
            }
        }
    }

    fn set(&self) {
        if self.0.swap(true, Ordering::Relaxed) {
            process::exit(INTERRUPTED.into());
        }
    }
}

/// What is waited for.
struct Signals {
    interrupt: Signal,
    terminate: Signal,
    size: Signal,
}
