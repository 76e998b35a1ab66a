//! SIGINT and SIGTERM of a command that writes files or runs long. The first sets a flag; a second ends the process at
//! once.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;

use crate::exit::INTERRUPTED;

/// Flag of the process, shared by all tasks, so that a signal between two tasks ends the second.
static FLAG: LazyLock<io::Result<Arc<AtomicBool>>> = LazyLock::new(watched);

/// Flag that the first SIGINT or SIGTERM sets.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Replaces the default actions of both signals and of SIGXFSZ for the rest of the process. A write beyond the file size
    /// limit then returns an error.
    ///
    /// # Errors
    /// When a signal cannot be caught.
    pub fn watch() -> io::Result<Self> {
        let flag = FLAG.as_ref().map_err(|error| error.kind())?;
        Ok(Self(Arc::clone(flag)))
    }

    /// Returns whether SIGINT or SIGTERM was received.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Sets the flag, as a signal does.
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
