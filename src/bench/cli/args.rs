//! Arguments of `demo`, `sim` and `robot`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use crate::live_bus::parsers;
use crate::quirks::QuirkArgs;
use crate::rig::CalibrationRig;
use run::config_arg::ConfigArg;
use run::interfaces::Interfaces;
use run::limits;
use run::results::Force;

/// `frhc demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Configuration file (TOML).
    #[arg(short, long, value_name = "FILE", default_value = "config/kraft_like.toml")]
    pub(super) config: PathBuf,
    /// Scenario of the operator's actions and injected faults: a name such as contact_10s or faults/unplug, or a .toml file.
    #[arg(short, long, value_name = "NAME|FILE", default_value = "teleoperation")]
    pub(super) scenario: String,
    /// Robot that follows the commands, simulated with masses, servos and a wrist sensor: a file such as
    /// config/robots/puma560.toml.
    #[arg(long, value_name = "FILE")]
    pub(super) robot: Option<PathBuf>,
    /// Duration in simulated seconds [default: that of the scenario].
    #[arg(long, value_name = "N", value_parser = parsers::seconds, allow_negative_numbers = true)]
    pub(super) seconds: Option<f64>,
    /// Seed of the operator's tremor.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    #[command(flatten)]
    pub(super) telemetry: TelemetryArgs,
    /// Record bus.log (candump format), summary.json and faults/ in this folder.
    #[arg(short, long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Size of bus.log at which the next part of the session begins, in MB [default: one part].
    #[arg(long, value_name = "MB", requires = "out", value_parser = limits::megabytes)]
    pub(super) part_size: Option<u64>,
    #[command(flatten)]
    pub(super) force: Force,
    /// Print the summary as one JSON object.
    #[arg(long)]
    pub(super) json: bool,
}

/// Speed of `frhc demo`, and its telemetry.
#[derive(Debug, Args)]
pub struct TelemetryArgs {
    /// Run in real time instead of as fast as possible.
    #[arg(long)]
    pub(super) realtime: bool,
    /// Run X times as fast as real time, as far as the processor allows.
    #[arg(long, value_name = "X", value_parser = parsers::speed, allow_negative_numbers = true)]
    pub(super) speed: Option<f64>,
    /// Show arm, robot and forces in a browser: serves the page of frhc view, in real time or at --speed.
    #[arg(long)]
    pub(super) view: bool,
    /// Address and port of that page; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = view::command::DEFAULT_ADDRESS, requires = "view")]
    pub(super) listen: SocketAddr,
    /// Offer the telemetry at this socket [default: in real time, that of frhc run; else none].
    #[arg(long = "telemetry", value_name = "PATH")]
    pub(super) socket: Option<PathBuf>,
}

impl TelemetryArgs {
    /// Returns the most seconds of virtual time in a second of the wall clock; `None` for as fast as possible.
    pub(super) fn speed(&self) -> Option<f64> {
        self.speed.or((self.realtime || self.view).then_some(1.0))
    }
}

/// `frhc sim`.
#[derive(Debug, Args)]
pub struct Sim {
    #[command(flatten)]
    pub(super) config: ConfigArg,
    #[command(flatten)]
    pub(super) interfaces: Interfaces,
    /// Scenario of the operator's actions and injected faults: a name such as contact_10s or faults/unplug, or a .toml file.
    #[arg(short, long, value_name = "NAME|FILE", default_value = "free")]
    pub(super) scenario: String,
    /// Seed of the operator's tremor, or of what the --calibrate options measure.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// Print each report of the drives' state as one JSON object per line.
    #[arg(long, conflicts_with = "rig")]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) quirks: QuirkArgs,
    #[command(flatten)]
    pub(super) rig: CalibrationRig,
}

/// `frhc robot`.
#[derive(Debug, Args)]
pub struct Robot {
    #[command(flatten)]
    pub(super) config: ConfigArg,
    /// Robot instead of that of remote.robot: a file such as config/robots/puma560.toml.
    #[arg(long, value_name = "FILE")]
    pub(super) robot: Option<PathBuf>,
    /// Socket on which the node listens, instead of that of remote.link.socket.
    #[arg(long, value_name = "PATH")]
    pub(super) socket: Option<PathBuf>,
    /// Number of the arm, equal at both ends, instead of that of remote.link.arm.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) arm: Option<u16>,
    /// Seed of the sensor's noise.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// Have the sensor of remote.link.sensor set its present load as zero, once, when it streams. It never happens without this.
    #[arg(long)]
    pub(super) bias: bool,
    /// Print each status as one JSON object per line.
    #[arg(long)]
    pub(super) json: bool,
}
