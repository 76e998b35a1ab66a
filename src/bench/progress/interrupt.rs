//! SIGINT and SIGTERM of long work: the first sets a flag, a second ends the process at once.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use thiserror::Error;

/// Exit code of a process that a signal has ended: that which shells report for SIGINT.
pub const EXIT_CODE: i32 = 128 + SIGINT;

/// The process's flag: one for all work in it, so that a signal between two pieces of work ends the second.
static FLAG: LazyLock<io::Result<Arc<AtomicBool>>> = LazyLock::new(watched);

/// Flag that the first SIGINT or SIGTERM sets.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// Signals cannot be received.
#[derive(Debug, Error)]
#[error("cannot receive signals: {0}")]
pub struct NoSignals(io::ErrorKind);

impl Interrupt {
    /// Replaces the default actions of both signals and of SIGXFSZ for the rest of the process; the write that exceeds the
    /// limit then returns an error.
    ///
    /// # Errors
    /// The actions cannot be replaced.
    pub fn watch() -> Result<Self, NoSignals> {
        let flag = FLAG.as_ref().map_err(|error| NoSignals(error.kind()))?;
        Ok(Self(Arc::clone(flag)))
    }

    /// Returns whether SIGINT or SIGTERM was received.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Sets it, as a signal does.
    #[cfg(test)]
    pub(super) fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn watched() -> io::Result<Arc<AtomicBool>> {
    let first = Arc::<AtomicBool>::default();
    for signal in [SIGINT, SIGTERM] {
        // In this order: the signal that sets the flag does not find it set.
        flag::register_conditional_shutdown(signal, EXIT_CODE, Arc::clone(&first))?;
        flag::register(signal, Arc::clone(&first))?;
    }
    flag::register(SIGXFSZ, Arc::default())?;
    Ok(first)
}
