//! The one argument nearly every task has.

use std::path::PathBuf;

use clap::Args;

/// Where the configuration is.
#[derive(Debug, Args)]
pub(super) struct Configured {
    /// The configuration.
    #[arg(short, long, value_name = "FILE")]
    pub(super) config: PathBuf,
}
