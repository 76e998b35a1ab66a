//! Arguments of `sim` and `robot`.

use std::path::PathBuf;

use clap::Args;

use crate::quirks::QuirkArgs;
use crate::rig::CalibrationRig;
use run::config_arg::ConfigArg;
use run::interfaces::Interfaces;

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
    /// Ask for SCHED_FIFO at this priority, 1 to 99; `frhc run` has 80. Otherwise the drives keep the one that they were
    /// started with.
    #[arg(long, value_name = "PRIORITY", conflicts_with = "rig", value_parser = clap::value_parser!(u8).range(1..=99))]
    pub(super) fifo: Option<u8>,
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
