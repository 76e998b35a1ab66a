//! `frhc experiment`: measurements on the simulation, with a table, and its data and picture as files.

mod fidelity;
mod picture;
mod report;

use clap::Subcommand;

use run::exit::Failure;

/// `frhc experiment`.
#[derive(Debug, Subcommand)]
pub(crate) enum Experiment {
    /// Compares what the hand feels with K_T times what is sensed, in the simulation's own truth.
    #[command(
        after_help = "Four hands meet a wall, hold, slide, press and let go, in pose mode, on the arm as identified, with 30 % less \
            friction, and without friction. --out writes runs.csv, force.svg and report.md. The exit code is 1 when a run \
            was stopped.\n\nExamples:\n  \
            frhc experiment fidelity --out fidelity\n  \
            frhc experiment fidelity --short --config config/jpl_like.toml --json | jq '.[].still_percent'"
    )]
    Fidelity(fidelity::Arguments),
}

/// Runs the experiment.
pub(super) fn run(experiment: &Experiment, quiet: bool) -> Result<(), Failure> {
    match experiment {
        Experiment::Fidelity(args) => fidelity::run(args, quiet),
    }
}
