//! The one argument nearly every task has.

use std::path::PathBuf;

use clap::Args;

use crate::exit::Failure;
use crate::exit::Kind;
use crate::exit::OrFail;
use config::Config;
use config::trust::Trust;

/// Where the configuration is.
#[derive(Debug, Args)]
pub struct Configured {
    /// The configuration.
    #[arg(short, long, value_name = "FILE")]
    pub config: PathBuf,
}

/// The same for a task that tells drives what it says.
#[derive(Debug, Args)]
pub struct Guarded {
    #[command(flatten)]
    configured: Configured,
    /// Use configuration and EDS files that others may write, or that are symbolic links.
    #[arg(long)]
    insecure: bool,
}

impl Guarded {
    /// Reads and checks it.
    pub(super) fn load(&self) -> Result<Config, Failure> {
        if self.insecure {
            tracing::warn!("--insecure: whoever may write the configuration decides what moves");
        }
        let trust = if self.insecure { Trust::Any } else { Trust::Guarded };
        Config::load_by(trust, &self.configured.config).or_fail(Kind::Configuration)
    }
}
