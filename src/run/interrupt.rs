//! SIGINT and SIGTERM of a command that writes files: the first completes them, a second ends the process at once.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;

use crate::exit::INTERRUPTED;

/// Flag that the first SIGINT or SIGTERM sets.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Replaces the default actions of both signals and of SIGXFSZ; the write that exceeds the limit then returns an
    /// error.
    ///
    /// # Errors
    /// A signal cannot be caught.
    pub fn watch() -> io::Result<Self> {
        let Self(first) = Self::default();
        for signal in [SIGINT, SIGTERM] {
            // In this order: the signal that sets the flag does not find it set.
            flag::register_conditional_shutdown(signal, INTERRUPTED.into(), Arc::clone(&first))?;
            flag::register(signal, Arc::clone(&first))?;
        }
        flag::register(SIGXFSZ, Arc::default())?;
        Ok(Self(first))
    }

    /// Returns whether SIGINT or SIGTERM was received.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
