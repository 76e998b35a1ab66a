//! `--config`, the option that nearly every command has.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::exit::{Failure, Kind, OrFail};
use config::Config;
use config::files::{Copies, Files};
use config::trust::Trust;

/// Path of the configuration.
#[derive(Debug, Args)]
pub struct ConfigArg {
    /// Configuration file (TOML).
    #[arg(short, long, value_name = "FILE")]
    pub config: PathBuf,
}

/// Path of the configuration of a command that enables drives: the file must not be writable by others.
#[derive(Debug, Args)]
pub struct TrustedConfigArg {
    #[command(flatten)]
    configured: ConfigArg,
    /// Accept configuration and EDS files that other users may write, or that are symbolic links.
    #[arg(long)]
    insecure: bool,
}

impl TrustedConfigArg {
    /// Returns the path of the configuration.
    pub(super) fn path(&self) -> &Path {
        &self.configured.config
    }

    /// Loads and validates the configuration. Also returns the contents of all files that were read.
    pub(super) fn load(&self) -> Result<(Config, Copies), Failure> {
        if self.insecure {
            tracing::warn!("--insecure: any user who can write the configuration controls the arm");
        }
        let trust = if self.insecure { Trust::Any } else { Trust::Guarded };
        let files = Files::on_disk(trust);
        let config = Config::load_from(&files, self.path()).or_fail(Kind::Configuration)?;
        Ok((config, files.copies()))
    }
}
