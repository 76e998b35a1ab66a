//! `frhc measure`: facts of an arm that a configuration states, measured at the arm.

mod direction;
mod sign;

use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::measured::{Measured, Task};
use config::Config;
use run::exit::Failure;
use run::print;

/// `frhc measure`.
#[derive(Debug, Args)]
pub struct MeasureArgs {
    #[command(subcommand)]
    task: Measurement,
}

/// Measurements.
#[derive(Debug, Subcommand)]
enum Measurement {
    /// Whether a positive torque raises the position: one drive after the other pushes, alone and little, the arm at rest.
    #[command(
        after_help = "Needs a deadman apart from the arm (switches.deadman_at), the arm at rest, and no hand on it. Each step says \
            which drive pushes, and with how much at most, and waits for the deadman; all other drives are off, and its torque limit \
            is written and read back before. What is right stands in MY.measured.toml beside it, and is not asked for again. A joint \
            that moves the other way, another one, or much too easily is exit 5, with the key; one that does not move is not proven \
            (exit 1). At its end the node boots, which writes the planned limits again.\n\nExample:\n  \
            frhc run --config my_arm.toml &\n  frhc measure sign --config my_arm.toml"
    )]
    Sign(SignArgs),
    /// Which way the joints turn and the grip goes: a person moves the arm of a running node, without torque.
    #[command(
        after_help = "Asks for a motion of each joint, then of the grip along and about x, y and z of the arm's base, and compares \
            it with the configuration. What is right stands in MY.measured.toml beside it, and is not asked for again. A motion \
            that contradicts the configuration is asked for twice; then the exit code is 5, with the key that is wrong. Ctrl-C \
            ends: what is left is not proven.\n\nExample:\n  \
            frhc run --config my_arm.toml &\n  frhc measure direction --config my_arm.toml"
    )]
    Direction(DirectionArgs),
}

/// `frhc measure direction`.
#[derive(Debug, Args)]
struct DirectionArgs {
    /// Configuration of the running node.
    #[arg(short, long, value_name = "FILE")]
    config: PathBuf,
    /// Telemetry socket of the node [default: that of the configuration, as for `frhc top`].
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Measure again what has been measured.
    #[arg(long)]
    again: bool,
}

/// `frhc measure sign`.
#[derive(Debug, Args)]
struct SignArgs {
    /// Configuration of the running node.
    #[arg(short, long, value_name = "FILE")]
    config: PathBuf,
    /// Joint, by its name or its number from 1 at the base [default: all].
    #[arg(long, value_name = "NAME")]
    joint: Option<String>,
    /// Measure again what has been measured.
    #[arg(long)]
    again: bool,
}

/// Measures.
///
/// # Errors
/// When the configuration is wrong (exit 5), or cannot be judged.
pub fn run(args: &MeasureArgs) -> Result<(), Failure> {
    match &args.task {
        Measurement::Sign(args) => sign::run(args),
        Measurement::Direction(args) => direction::run(args),
    }
}

/// Reads what has been measured, without what is measured `again` or depends on facts that have changed.
fn begin(config: &Config, task: Task, again: bool) -> Result<Measured, Failure> {
    let mut measured = Measured::read(config)?;
    if again {
        measured.forget(task);
    } else if measured.is_void(task) {
        print::line(
            "The configuration has changed since the last measurement: all is measured again.",
        );
    }
    Ok(measured)
}
