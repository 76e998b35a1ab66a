//! SIGINT and SIGTERM of a command that writes files: the first completes them, a second ends the process at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::{io, process, thread};

use tokio::signal::unix::{Signal, SignalKind, signal};

use run::exit::INTERRUPTED;

/// Signal number of SIGXFSZ (file size limit exceeded) on Linux, except on MIPS.
const SIGXFSZ: i32 = 25;

/// Flag that the first SIGINT or SIGTERM sets.
#[derive(Clone, Debug, Default)]
pub(super) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Replaces the default actions of both signals and of SIGXFSZ; the write that exceeds the limit then returns an
    /// error.
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

    /// Returns whether SIGINT or SIGTERM was received.
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

/// Handlers of the signals.
struct Signals {
    interrupt: Signal,
    terminate: Signal,
    size: Signal,
}
