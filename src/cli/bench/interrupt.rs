//! SIGINT and SIGTERM end a talk in order: what is in the middle of something is told so.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

use anyhow::Context;

use run::exit::Failure;
use run::exit::Kind;
use run::exit::OrFail;
use run::signals;

/// A flag that is set by the first of these signals. Its thread ends with the process.
pub(super) fn flag() -> Result<Arc<AtomicBool>, Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("no runtime").or_fail(Kind::Bus)?;
    let stop = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&stop);
    thread::spawn(move || {
        runtime.block_on(signals::wait());
        set.store(true, Ordering::Relaxed);
    });
    Ok(stop)
}
