//! `--socket` and `--config` of commands that read the telemetry of a node.

use std::path::PathBuf;

use clap::Args;

use crate::exit::{Failure, Kind, OrFail};
use crate::feed_socket;
use config::Config;

/// Options that select the telemetry socket of a node.
#[derive(Debug, Args)]
pub struct ViewerArgs {
    /// Telemetry socket of the node [default: $XDG_RUNTIME_DIR/frhc-view/telemetry.sock, then /run/frhc-view/telemetry.sock].
    #[arg(long, value_name = "PATH")]
    pub socket: Option<PathBuf>,
    /// Read the path of the telemetry socket from this configuration.
    #[arg(short, long, value_name = "FILE", conflicts_with = "socket")]
    pub config: Option<PathBuf>,
}

impl ViewerArgs {
    /// Returns the paths to try: that of the option or of the configuration, else the default ones.
    ///
    /// # Errors
    /// Returns an error if the configuration is invalid (exit 3).
    pub fn sockets(&self) -> Result<Vec<PathBuf>, Failure> {
        if let Some(socket) = &self.socket {
            return Ok(vec![socket.clone()]);
        }
        let Some(file) = &self.config else { return Ok(feed_socket::default_sockets()) };
        let config = Config::load(file).or_fail(Kind::Configuration)?;
        let is_configured = config.telemetry_socket.is_some() || config.socket.is_some();
        Ok(match is_configured {
            true => vec![feed_socket::of_config(&config)],
            false => feed_socket::default_sockets(),
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::scratch;

    /// Returns the sockets for a configuration with these keys in `[node]`.
    fn sockets(keys: &str) -> Vec<PathBuf> {
        let folder = scratch::path("viewer");
        let config = Some(scratch::configuration(&folder, keys));
        let sockets = ViewerArgs { socket: None, config }.sockets().unwrap();
        fs::remove_dir_all(&folder).unwrap();
        sockets
    }

    #[test]
    fn configuration_names_the_telemetry_socket() {
        assert_eq!(sockets("telemetry_socket = \"/a/feed.sock\""), [Path::new("/a/feed.sock")]);
        let beside = sockets("socket = \"/a/node.sock\"");
        assert_eq!(beside, [Path::new("/a/view/telemetry.sock")]);
        assert_eq!(sockets(""), feed_socket::default_sockets());
        let absent = ViewerArgs { socket: None, config: Some("absent.toml".into()) };
        assert!(absent.sockets().unwrap_err().to_string().contains("absent.toml"));
    }
}
