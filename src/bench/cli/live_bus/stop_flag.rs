//! A flag set by SIGINT and SIGTERM: a session then aborts its transfer in order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use anyhow::Context;

use crate::signals;
use run::exit::{Failure, Kind, OrFail};

/// Returns a flag that the first of these signals sets. Its thread ends with the process.
pub(super) fn new() -> Result<Arc<AtomicBool>, Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("cannot start the async runtime").or_fail(Kind::Bus)?;
    let stop = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&stop);
    thread::spawn(move || {
        runtime.block_on(signals::wait_for_stop());
        set.store(true, Ordering::Relaxed);
    });
    Ok(stop)
}
