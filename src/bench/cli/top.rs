//! `frhc top`: a running node in a terminal.

use std::path::PathBuf;

use clap::Args;

use run::exit::Failure;
use run::feed_socket::default_sockets;
use view::top;

/// `frhc top`.
#[derive(Debug, Args)]
pub struct Top {
    /// Telemetry socket of the node [default: $XDG_RUNTIME_DIR/frhc-view/telemetry.sock, then /run/frhc-view/telemetry.sock].
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Print one snapshot as plain text, and end.
    #[arg(long)]
    once: bool,
}

/// Shows the node.
pub(super) fn run(args: &Top) -> Result<(), Failure> {
    let sockets = args.socket.clone().map_or_else(default_sockets, |socket| vec![socket]);
    if args.once { top::print_once(sockets) } else { top::watch(sockets) }
}
