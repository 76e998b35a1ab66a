//! `frhc view`: serves the page until a signal.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use tokio::runtime::Builder;
use tokio::signal::unix::{SignalKind, signal};

use crate::server::Server;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::viewer_args::ViewerArgs;

/// Address of the page if none is given.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8020";

/// `frhc view`.
#[derive(Debug, Args)]
pub struct View {
    /// Address and port of the page; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = DEFAULT_ADDRESS)]
    listen: SocketAddr,
    #[command(flatten)]
    viewer: ViewerArgs,
}

/// Serves the page until SIGINT or SIGTERM.
///
/// # Errors
/// Returns an error if the configuration is invalid, or the address cannot be used or printed.
pub fn execute(args: &View) -> Result<(), Failure> {
    let server = bind(args.listen, args.viewer.sockets()?)?;
    let address = server.address();
    // Before the line is printed: its reader may send a signal at once.
    let runtime = Builder::new_current_thread().enable_io().build().or_fail(Kind::System)?;
    let entered = runtime.enter();
    let mut interrupt = signal(SignalKind::interrupt()).or_fail(Kind::System)?;
    let mut terminate = signal(SignalKind::terminate()).or_fail(Kind::System)?;
    drop(entered);
    let _running = server.start().or_fail(Kind::System)?;
    print::line(&format!("http://{address}/"));
    if print::has_failed() {
        return print::finish();
    }
    runtime.block_on(async {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    });
    Ok(())
}

/// Takes the address of the page, and warns where others reach it.
///
/// # Errors
/// Returns an error if the address cannot be used.
pub fn bind(listen: SocketAddr, sockets: Vec<PathBuf>) -> Result<Server, Failure> {
    if !listen.ip().is_loopback() {
        print::note(&format!(
            "frhc: {listen}: everyone who reaches this address may look, without a password"
        ));
    }
    Server::bind(listen, sockets).map_err(|error| Failure::new(Kind::Bus, refused(listen, &error)))
}

fn refused(listen: SocketAddr, error: &io::Error) -> String {
    let is_taken = error.kind() == io::ErrorKind::AddrInUse;
    let remedy = if is_taken { "; --listen takes another port, and port 0 a free one" } else { "" };
    format!("{listen}: {error}{remedy}")
}
