//! `frhc export`: what other programs read.

mod dbc;

use clap::Subcommand;

use crate::cli::exit::Failure;

/// `frhc export`.
#[derive(Debug, Subcommand)]
pub(super) enum Export {
    /// The frames of the buses as a DBC file, with SI scales and joint names.
    #[command(
        after_help = "Examples:\n  frhc export dbc --config config/kraft_like.toml --out kraft_like.dbc\n  \
                      cantools decode kraft_like.dbc < session/bus.log\n  \
                      frhc export dbc --config config/kraft_like.toml --bus wrist | less"
    )]
    Dbc(dbc::Dbc),
}

/// Writes what is asked for.
pub(super) fn run(export: &Export) -> Result<(), Failure> {
    match export {
        Export::Dbc(args) => dbc::run(args),
    }
}
