//! `frhc calib`: torque curves from measurements, and those of a configuration looked at.

mod check;
mod fit;
mod fragment;
mod report;
mod session;

use std::path::PathBuf;

use clap::Args;
use clap::Subcommand;

use run::configured::Configured;
use run::exit::Failure;
use run::results::Force;

/// `frhc calib`.
#[derive(Debug, Args)]
pub(crate) struct Calib {
    /// What to do.
    #[command(subcommand)]
    task: Task,
}

/// What to do with torque curves.
#[derive(Debug, Subcommand)]
enum Task {
    /// Fits a torque curve to the measurements of each joint.
    #[command(
        after_help = "The file has a line of column names: joint, direction (up or down), per_mille (6071h), and torque_nm \
            (force_n for sliding joints). Lines that begin with # say where it comes from.\n\n\
            Example:\n  frhc calib fit azimuth.csv --config config/kraft_like.toml --out /tmp/azimuth"
    )]
    Fit(Fit),
    /// Shows the torque curves of a configuration: slope, range, resolution, largest target.
    #[command(after_help = "Example:\n  frhc calib check --config config/kraft_like.toml")]
    Check(Check),
}

/// `frhc calib fit`.
#[derive(Debug, Args)]
struct Fit {
    /// The measurements.
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    /// This joint alone, by its name or number.
    #[arg(long, value_name = "JOINT")]
    joint: Option<String>,
    /// The configuration, for the joints' names, gears and rated torques.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Leave torque_curves.toml and a picture of every joint here.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// The result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// `frhc calib check`.
#[derive(Debug, Args)]
struct Check {
    #[command(flatten)]
    config: Configured,
    /// The findings as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Does it.
pub(super) fn run(args: &Calib) -> Result<(), Failure> {
    match &args.task {
        Task::Fit(args) => fit::run(args),
        Task::Check(args) => check::run(args),
    }
}
