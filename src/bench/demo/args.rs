//! Arguments of `frhc demo`.

use std::path::PathBuf;

use clap::Args;

use crate::parsers;
use run::limits;
use run::results::Force;

/// `frhc demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Configuration file (TOML).
    #[arg(short, long, value_name = "FILE", default_value = "config/kraft_like.toml")]
    pub(crate) config: PathBuf,
    /// Scenario of the operator's actions and injected faults: a name such as contact_10s or faults/unplug, or a .toml file.
    #[arg(short, long, value_name = "NAME|FILE", default_value = "teleoperation")]
    pub(crate) scenario: String,
    /// Robot that follows the commands, simulated with masses, servos and a wrist sensor: a file such as
    /// config/robots/puma560.toml.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: Option<PathBuf>,
    /// Duration in simulated seconds [default: that of the scenario].
    #[arg(long, value_name = "N", value_parser = parsers::seconds, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Seed of the operator's tremor.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) telemetry: TelemetryArgs,
    /// Record bus.log (candump format), summary.json and faults/ in this folder.
    #[arg(
        short = 'r',
        short_alias = 'o',
        long = "record",
        visible_alias = "out",
        value_name = "DIR"
    )]
    pub(crate) out: Option<PathBuf>,
    /// Size of bus.log at which the next part of the session begins, in MB [default: one part].
    #[arg(long, value_name = "MB", requires = "out", value_parser = limits::megabytes)]
    pub(crate) part_size: Option<u64>,
    #[command(flatten)]
    pub(crate) force: Force,
    /// Print the summary as one JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Speed of `frhc demo`, and its telemetry.
#[derive(Debug, Args)]
pub struct TelemetryArgs {
    /// Run in real time instead of as fast as possible.
    #[arg(long)]
    pub(crate) realtime: bool,
    /// Run X times as fast as real time, as far as the processor allows.
    #[arg(long, value_name = "X", value_parser = parsers::speed, allow_negative_numbers = true)]
    pub(crate) speed: Option<f64>,
    #[cfg(feature = "view")]
    #[command(flatten)]
    pub(crate) page: PageArgs,
    /// Offer the telemetry at this socket [default: in real time, that of frhc run; else none].
    #[arg(long = "telemetry", value_name = "PATH")]
    pub(crate) socket: Option<PathBuf>,
}

impl TelemetryArgs {
    /// Returns the most seconds of virtual time in a second of the wall clock; `None` for as fast as possible.
    pub(crate) fn speed(&self) -> Option<f64> {
        self.speed.or((self.realtime || self.has_page()).then_some(1.0))
    }

    /// Returns whether a page in a browser shows the demo.
    pub(crate) const fn has_page(&self) -> bool {
        #[cfg(feature = "view")]
        return self.page.view;
        #[cfg(not(feature = "view"))]
        false
    }
}

/// The page that shows the demo.
#[cfg(feature = "view")]
#[derive(Debug, Args)]
pub(crate) struct PageArgs {
    /// Show arm, robot and forces in a browser: serves the page of frhc view, in real time or at --speed.
    #[arg(long)]
    pub(crate) view: bool,
    /// Address and port of that page; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = view::command::DEFAULT_ADDRESS, requires = "view")]
    pub(crate) listen: std::net::SocketAddr,
}
