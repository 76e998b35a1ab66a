//! A flag that SIGINT and SIGTERM set, so that `commission` ends in order. For `run` see
//! [`stop_signals`](crate::stop_signals).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::{io, thread};

use tokio::signal::unix::{SignalKind, signal};

/// Returns the flag, for commands without an async runtime of their own. Starts a thread
/// that receives the signals until the process ends.
pub(super) fn new() -> io::Result<Arc<AtomicBool>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let registered = runtime.block_on(async {
        let kinds = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()];
        let [interrupt, terminate, hang_up] = kinds.map(signal);
        io::Result::Ok((interrupt?, terminate?, hang_up?))
    });
    let (mut interrupt, mut terminate, hang_up) = registered?;
    let flag = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&flag);
    let receive = async move {
        // SIGHUP is caught and ignored: a closed terminal does not stop the drives.
        let _hang_up = hang_up;
        loop {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
            stop.store(true, Ordering::Relaxed);
        }
    };
    let receive = move || runtime.block_on(receive);
    thread::Builder::new().name("frhc-signals".to_owned()).spawn(receive)?;
    Ok(flag)
}
