//! The command line: arguments, tasks, exit codes. The only module that prints.

mod archive;
mod args;
pub mod bench;
mod calib;
mod campaign;
mod check;
mod commission;
mod configured;
mod console;
mod ctl;
mod decode;
mod demo;
mod exit;
mod explain;
mod export;
mod fault_records;
mod faults;
mod gains;
mod interfaces;
mod interrupt;
mod keeper;
mod latch;
mod log_file;
mod lss;
mod nmt;
mod orders;
mod panics;
mod personality;
mod plan;
mod print;
mod provenance;
mod recorder;
mod results;
mod rig;
mod rings;
mod run;
mod scan;
mod scenario;
mod sdo;
mod session;
mod signals;
mod sim;
mod state;
mod stderr;
mod story;
mod time_line;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::filter::LevelFilter;

use crate::cli::args::Cli;
use crate::cli::args::Command;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::time_line::Stamped;

/// Runs the program with the process's arguments.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(answer) => return answered(&answer),
    };
    if matches!(cli.command, Command::Run(_)) {
        if let Err(error) = orders::block() {
            let reason = format!("signals cannot be blocked: {error}");
            return conclude(Err(Failure::new(Kind::Bus, reason)));
        }
        stderr::detach();
        panics::abort();
    }
    log(cli.quiet, cli.verbose);
    let done = match &cli.command {
        Command::Demo(args) => demo::run(args, cli.quiet),
        Command::Campaign(args) => campaign::run(args, cli.quiet),
        Command::Run(args) => run::run(args),
        Command::Sim(args) => sim::run(args),
        Command::Ctl(args) => ctl::run(args),
        Command::Check(args) => check::run(args),
        Command::Commission(args) => commission::run(args),
        Command::Plan(args) => plan::run(args),
        Command::Explain(args) => explain::run(args),
        Command::Calib(args) => calib::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Sdo(args) => sdo::run(args),
        Command::Nmt(args) => nmt::run(args),
        Command::Lss(args) => lss::run(args),
        Command::Decode(args) => decode::run(args, cli.quiet),
        Command::Export(args) => export::run(args),
    };
    let code = conclude(done);
    stderr::flush();
    code
}

/// Prints what failed, the output included, and returns the code of the first failure.
fn conclude(done: Result<(), Failure>) -> ExitCode {
    let failures = [done, print::finish()].map(Result::err);
    let failures: Vec<Failure> = failures.into_iter().flatten().collect();
    failures.iter().for_each(|failure| print::error(&failure.to_string()));
    failures.first().map_or(ExitCode::SUCCESS, Failure::code)
}

/// Prints help or version on stdout, or what is wrong with the command line on stderr.
fn answered(answer: &clap::Error) -> ExitCode {
    let printed = answer.print();
    if answer.use_stderr() {
        return ExitCode::from(2);
    }
    print::keep(printed);
    conclude(Ok(()))
}

/// Messages for people go to stderr; `-q` leaves errors, `-v` adds detail.
fn log(quiet: bool, verbose: u8) {
    let level = match (quiet, verbose) {
        (true, _) => LevelFilter::ERROR,
        (false, 0) => LevelFilter::INFO,
        (false, 1) => LevelFilter::DEBUG,
        (false, _) => LevelFilter::TRACE,
    };
    let ansi = std::env::var_os("NO_COLOR").is_none()
        && std::io::IsTerminal::is_terminal(&std::io::stderr());
    tracing_subscriber::fmt()
        .with_writer(|| {
            let stderr: Box<dyn Write> = match stderr::lines() {
                Some(lines) => Box::new(lines),
                None => Box::new(std::io::stderr()),
            };
            Stamped(stderr)
        })
        .with_max_level(level)
        .with_target(false)
        .with_ansi(ansi)
        .without_time()
        .init();
}
