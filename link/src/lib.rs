//! `frhc-link`: carries the link between a node and its far side over a network, by zenoh (docs/link.md, ADR 39).
//!
//! ```text
//!  frhc run ── Unix socket ── frhc-link near ══ QUIC, mutual TLS ══ frhc-link far ── Unix socket ── frhc robot
//! ```
//!
//! It trusts neither side. It passes only messages of the contract for this arm; the ends decide whether they act.
//!
//! Begin with `link.rs`, the threads from the local socket to zenoh and back. `role.rs` has what each end may do, `flow.rs` how
//! many messages may be under way, `keys.rs` the authority and both ends.
#![forbid(unsafe_code)]

pub mod certificate;
mod clock;
pub mod failure;
mod flow;
pub mod keys;
mod link;
mod local;
mod log;
mod mailbox;
pub mod network;
mod peers;
pub mod priority;
pub mod role;
pub mod settings;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::role::Role;

/// Carries the link between a node and its far side over a network.
#[derive(Debug, Parser)]
#[command(
    name = "frhc-link",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Exit codes: 0 success, 2 usage, 3 invalid configuration or certificate, 4 socket, network or file.\n\n\
    Examples:\n  frhc-link key new keys\n  frhc-link near --config link.toml"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Log errors and warnings only.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Log what zenoh does, too.
    #[arg(short, long, global = true)]
    verbose: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Runs the end beside the node, until SIGTERM or SIGINT.
    Near(End),
    /// Runs the end beside the robot, until SIGTERM or SIGINT.
    Far(End),
    /// Makes and shows the keys of both ends.
    #[command(subcommand)]
    Key(Key),
}

#[derive(Debug, clap::Args)]
struct End {
    /// Settings; docs/network.md has the keys.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
}

#[derive(Debug, Subcommand)]
enum Key {
    /// Makes an authority, and a key and certificate for each end, in a new folder. Never overwrites.
    New(NewKeys),
    /// Shows whose certificates a folder has, until when they are valid, and what is wrong with them.
    Show {
        /// Folder of the keys.
        folder: PathBuf,
    },
}

#[derive(Debug, clap::Args)]
struct NewKeys {
    /// Folder of the keys; must not exist, or be empty.
    folder: PathBuf,
    /// Number of the arm.
    #[arg(long, default_value_t = 1)]
    arm: u16,
    /// Makes a key for a router between the ends, too.
    #[arg(long)]
    router: bool,
    /// Days for which the certificates are valid.
    #[arg(long, default_value_t = 3_650, value_parser = clap::value_parser!(u32).range(1..=36_500))]
    days: u32,
}

/// Runs the program with the arguments of the process.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    log::start(cli.quiet, cli.verbose);
    let done = match &cli.command {
        Command::Near(end) => link::run(Role::Near, &end.config),
        Command::Far(end) => link::run(Role::Far, &end.config),
        Command::Key(Key::New(new)) => keys::make(&new.folder, new.arm, new.router, new.days),
        Command::Key(Key::Show { folder }) => keys::show(folder),
    };
    done.map_or_else(|failure| failure.report(), |()| ExitCode::SUCCESS)
}
