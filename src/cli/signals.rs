//! SIGINT and SIGTERM end a run in order.

use tokio::signal::unix::SignalKind;
use tokio::signal::unix::signal;

/// Waits for one of them and names it.
pub(super) async fn wait() -> &'static str {
    let interrupt = signal(SignalKind::interrupt());
    let terminate = signal(SignalKind::terminate());
    let (Ok(mut interrupt), Ok(mut terminate)) = (interrupt, terminate) else {
        // Without handlers the signals keep their default action: they end the process.
        return std::future::pending().await;
    };
    tokio::select! {
        _ = interrupt.recv() => "SIGINT",
        _ = terminate.recv() => "SIGTERM",
    }
}
