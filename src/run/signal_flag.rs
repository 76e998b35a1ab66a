//! Flag set by signals in place of their default action. For `run` see [`stop_signals`](crate::stop_signals).

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use signal_hook::flag;

use crate::exit::{Failure, Kind, OrFail};

/// Registers a flag that each of these signals sets, in place of its default action.
///
/// # Errors
/// When a signal cannot be caught.
pub fn register(signals: impl IntoIterator<Item = i32>) -> Result<Arc<AtomicBool>, Failure> {
    let set = Arc::new(AtomicBool::new(false));
    let mut signals = signals.into_iter();
    let caught = signals.try_for_each(|signal| flag::register(signal, Arc::clone(&set)).map(drop));
    caught.context("cannot receive signals").or_fail(Kind::System).map(|()| set)
}
