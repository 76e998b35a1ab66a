//! `frhc config`: changes to a configuration file that keep its comments, order and format.

mod fragment;
mod kind;
mod line_ends;
mod merge;
mod merged;
mod original;
mod put;
mod source;

use std::path::PathBuf;

use clap::{Args, Subcommand};

use run::exit::Failure;

/// `frhc config`.
#[derive(Debug, Args)]
pub struct ConfigArgs {
    #[command(subcommand)]
    task: Task,
}

/// Tasks of `frhc config`.
#[derive(Debug, Subcommand)]
enum Task {
    /// Puts the keys of fragments, as `frhc calib` writes them, into a configuration; shows the difference and what `check` says.
    #[command(
        after_help = "A [[joint]] of a fragment changes the joint of the same name; tables are merged key by key. Comments, order and \
            format of the file stay. Without --write no file changes. With it the old file is kept as MY.toml.1, .2 and so on, \
            and nothing is written that `frhc check` refuses.\n\nExamples:\n  \
            frhc config merge my_arm.toml elbow/torque_curves.toml sweep/friction.toml\n  \
            frhc config merge my_arm.toml elbow/torque_curves.toml --write\n  \
            cat */friction.toml | frhc config merge my_arm.toml -"
    )]
    Merge(Merge),
}

/// `frhc config merge`.
#[derive(Debug, Args)]
struct Merge {
    /// Configuration file.
    #[arg(value_name = "MY.toml")]
    config: PathBuf,
    /// Files with the keys to put in. `-` reads stdin.
    #[arg(value_name = "FRAGMENT", required = true)]
    fragments: Vec<PathBuf>,
    /// Write the configuration, and keep the old file beside it.
    #[arg(long)]
    write: bool,
}

/// Executes the task.
pub(super) fn run(args: &ConfigArgs) -> Result<(), Failure> {
    match &args.task {
        Task::Merge(args) => merge::run(args),
    }
}
