//! `frhc-lab`: the program of the experiments. `frhc` depends on nothing of it.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use experiments::command::peg::{self, Peg};
use experiments::command::{self, Experiment};
use frhc::{LogArgs, conclude, init_log, print_usage};

/// Experiments of the paper and haptic measurements, on simulated drives, hands and robots.
#[derive(Debug, Parser)]
#[command(
    name = "frhc-lab",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Exit codes are those of frhc: 0 success, 1 negative result, 2 usage, 3 invalid configuration, 4 file, 5 drive.\n\n\
        Example:\n  frhc-lab experiment fidelity --short"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    log: LogArgs,
}

/// The commands of the program.
#[derive(Debug, Subcommand)]
enum Command {
    /// Measures on the simulation what is felt and what it costs.
    #[command(subcommand, after_help = "Example:\n  frhc-lab experiment fidelity --short")]
    Experiment(Experiment),
    /// Prints the contact of one peg with the plate and its hole, and where a lowered peg ends.
    Peg(Peg),
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return print_usage(&error),
    };
    init_log(cli.log);
    conclude(match &cli.command {
        Command::Experiment(experiment) => command::run(experiment, cli.log.quiet),
        Command::Peg(args) => peg::run(args),
    })
}

#[cfg(test)]
mod tests;
