//! Sockets at which a node's telemetry is looked for.

use std::env;
use std::path::PathBuf;

/// Returns the sockets of the user's own node and of the service, in this order.
pub fn default_sockets() -> Vec<PathBuf> {
    let own = env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|path| path.is_absolute());
    let folders = own.into_iter().chain([PathBuf::from("/run")]);
    folders.map(|folder| folder.join("frhc-view/telemetry.sock")).collect()
}
