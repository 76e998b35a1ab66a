//! What `demo` and `sim` take.

use std::path::PathBuf;

use clap::Args;

use crate::cli::bench::words;
use crate::cli::quirks::QuirkArgs;
use crate::cli::rig::Calibrate;
use run::configured::Configured;
use run::interfaces::Interfaces;
use run::results::Force;

/// `frhc demo`.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// The configuration.
    #[arg(short, long, value_name = "FILE", default_value = "config/kraft_like.toml")]
    pub(super) config: PathBuf,
    /// What the operator does and what breaks: a name as contact_10s or faults/unplug, or a file ending in .toml.
    #[arg(short, long, value_name = "NAME|FILE", default_value = "teleoperation")]
    pub(super) scenario: String,
    /// How long, in simulated seconds; the scenario's own length if not given.
    #[arg(long, value_name = "N", value_parser = words::seconds, allow_negative_numbers = true)]
    pub(super) seconds: Option<f64>,
    /// Seed of the operator's tremor.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// As fast as the clock on the wall, not faster.
    #[arg(long)]
    pub(super) realtime: bool,
    /// Leave bus.log (candump), summary.json and faults/ here; an earlier session is not written over.
    #[arg(short, long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) force: Force,
    /// The summary as one JSON object.
    #[arg(long)]
    pub(super) json: bool,
}

/// `frhc sim`.
#[derive(Debug, Args)]
pub(crate) struct Sim {
    #[command(flatten)]
    pub(super) config: Configured,
    #[command(flatten)]
    pub(super) interfaces: Interfaces,
    /// What the operator does and what breaks: a name as contact_10s or faults/unplug, or a file ending in .toml.
    #[arg(short, long, value_name = "NAME|FILE", default_value = "free")]
    pub(super) scenario: String,
    /// Seed of the operator's tremor, or of the unknown torque curve.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// What each drive believes as one JSON object per line.
    #[arg(long, conflicts_with = "calibrate")]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) quirks: QuirkArgs,
    #[command(flatten)]
    pub(super) rig: Calibrate,
}
