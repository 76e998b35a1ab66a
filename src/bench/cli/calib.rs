//! `frhc calib`: torque curves and friction fitted to measurements, and a check of the curves of a configuration.

mod check;
mod fit;
mod fragment;
mod friction;
mod judgement;
mod plot;
mod report;
mod session;

use std::path::PathBuf;

use clap::{Args, Subcommand};

use run::config_arg::ConfigArg;
use run::exit::Failure;
use run::results::Force;

/// `frhc calib`.
#[derive(Debug, Args)]
pub struct Calib {
    #[command(subcommand)]
    task: Task,
}

/// Tasks of `frhc calib`.
#[derive(Debug, Subcommand)]
enum Task {
    /// Fits a torque curve to the measurements of each joint.
    #[command(
        after_help = "The CSV file has the columns joint, direction (up or down), per_mille (6071h) and torque_nm (force_n for \
            prismatic joints), named in its first line. Lines that begin with # are comments on its origin.\n\n\
            Example:\n  frhc calib fit azimuth.csv --config config/kraft_like.toml --out /tmp/azimuth"
    )]
    Fit(Fit),
    /// Fits Coulomb and viscous friction to recorded slow sweeps, and compares held postures with gravity. Moves nothing.
    #[command(
        after_help = "A CSV file has the columns joint, velocity_rad_per_s (velocity_m_per_s for prismatic joints) and per_mille \
            (6077h), named in its first line. With q1 to q6 (rad or m) gravity is subtracted. A line with velocity 0 and a \
            direction, up or down, is a held posture: the side from which the joint came.\n\n\
            Example:\n  frhc calib friction elbow.csv --config config/kraft_like.toml --out /tmp/elbow"
    )]
    Friction(Friction),
    /// Shows slope, range, resolution and largest target of the torque curves of a configuration.
    #[command(after_help = "Example:\n  frhc calib check --config config/kraft_like.toml")]
    Check(Check),
}

/// `frhc calib fit`.
#[derive(Debug, Args)]
struct Fit {
    /// Measurements.
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    /// Fit only this joint, by name or number.
    #[arg(long, value_name = "JOINT")]
    joint: Option<String>,
    /// Configuration with the joints' names, gear ratios and rated torques.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Write torque_curves.toml and a plot of every joint to this folder.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// `frhc calib friction`.
#[derive(Debug, Args)]
struct Friction {
    /// Recorded sweeps.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    config: ConfigArg,
    /// Fit only this joint, by name or number.
    #[arg(long, value_name = "JOINT")]
    joint: Option<String>,
    /// Write friction.toml to this folder.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// `frhc calib check`.
#[derive(Debug, Args)]
struct Check {
    #[command(flatten)]
    config: ConfigArg,
    /// Print the findings as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Executes the task.
pub(super) fn run(args: &Calib) -> Result<(), Failure> {
    match &args.task {
        Task::Fit(args) => fit::run(args),
        Task::Friction(args) => friction::run(args),
        Task::Check(args) => check::run(args),
    }
}
