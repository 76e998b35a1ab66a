//! `frhc top`: a running node in a terminal.

use clap::Args;

use run::exit::Failure;
use run::viewer_args::ViewerArgs;
use view::top;

/// `frhc top`.
#[derive(Debug, Args)]
pub struct Top {
    #[command(flatten)]
    viewer: ViewerArgs,
    /// Print one snapshot as plain text, and end.
    #[arg(long)]
    once: bool,
}

/// Shows the node.
pub(super) fn run(args: &Top) -> Result<(), Failure> {
    let sockets = args.viewer.sockets()?;
    if args.once { top::print_once(sockets) } else { top::watch(sockets) }
}
