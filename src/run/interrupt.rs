//! SIGINT and SIGTERM of a command that writes files, or works for long: the first sets a flag, a second ends the process at once.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;

use crate::exit::INTERRUPTED;

/// The process's flag: one for all work in it, so that a signal between two pieces of work ends the second.
static FLAG: LazyLock<io::Result<Arc<AtomicBool>>> = LazyLock::new(watched);

/// Flag that the first SIGINT or SIGTERM sets.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Replaces the default actions of both signals and of SIGXFSZ for the rest of the process; the write that exceeds the
    /// limit then returns an error.
    ///
    /// # Errors
    /// A signal cannot be caught.
    pub fn watch() -> io::Result<Self> {
        let flag = FLAG.as_ref().map_err(|error| error.kind())?;
        Ok(Self(Arc::clone(flag)))
    }

    /// Returns whether SIGINT or SIGTERM was received.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Sets it, as a signal does.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn watched() -> io::Result<Arc<AtomicBool>> {
    let first = Arc::<AtomicBool>::default();
    for signal in [SIGINT, SIGTERM] {
        // In this order: the signal that sets the flag does not find it set.
        flag::register_conditional_shutdown(signal, INTERRUPTED.into(), Arc::clone(&first))?;
        flag::register(signal, Arc::clone(&first))?;
    }
    flag::register(SIGXFSZ, Arc::default())?;
    Ok(first)
}
