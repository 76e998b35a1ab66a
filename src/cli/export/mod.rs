//! `frhc export`: files for other tools, made from a configuration.

mod dcf;

use clap::Args;
use clap::Subcommand;

use crate::cli::exit::Failure;

/// `frhc export`.
#[derive(Debug, Args)]
pub(super) struct Export {
    /// What to make.
    #[command(subcommand)]
    format: Format,
}

/// What to make.
#[derive(Debug, Subcommand)]
enum Format {
    /// A device configuration file (CiA 306) for each drive and the switch box.
    #[command(
        after_help = "Example:\n  frhc export dcf --config config/kraft_like_500hz.toml --out /tmp/dcf"
    )]
    Dcf(dcf::Dcf),
}

/// Makes it.
pub(super) fn run(args: &Export) -> Result<(), Failure> {
    match &args.format {
        Format::Dcf(args) => dcf::run(args),
    }
}
