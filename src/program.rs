//! The process: its command line, its log, its exit code.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use clap::Subcommand;
use tracing_subscriber::filter::LevelFilter;

use run::exit::Failure;
use run::exit::Kind;
use run::orders;
use run::panics;
use run::print;
use run::stderr;
use run::time_line::Stamped;

const EXAMPLES: &str = if cfg!(feature = "simulation") {
    "Every command has examples: frhc help decode. The exit codes: 0 done, 1 answered no, 2 command line, \
     3 configuration, 4 interface or file, 5 drive, 6 latched stop.\n\nExamples:\n  \
     frhc demo\n  frhc check --config config/kraft_like.toml\n  frhc explain faults"
} else {
    "Every command has examples: frhc help run. The exit codes: 0 done, 1 answered no, 2 command line, \
     3 configuration, 4 interface or file, 5 drive, 6 latched stop.\n\nExamples:\n  \
     frhc check --config config/kraft_like.toml\n  frhc ctl status"
};

/// The CANopen master of a force-reflecting hand controller.
#[derive(Debug, Parser)]
#[command(
    name = "frhc",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = EXAMPLES
)]
struct Cli {
    /// What to do.
    #[command(subcommand)]
    command: Command,
    /// Say less: errors only.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Say more; twice for everything.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

/// What to do.
#[derive(Debug, Subcommand)]
enum Command {
    #[cfg(feature = "simulation")]
    #[command(flatten)]
    Bench(crate::cli::Command),
    #[command(flatten)]
    Rack(run::command::Command),
}

/// Runs the program with the process's arguments.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(answer) => return answered(&answer),
    };
    if matches!(&cli.command, Command::Rack(command) if command.is_run()) {
        if let Err(error) = orders::block() {
            let reason = format!("signals cannot be blocked: {error}");
            return conclude(Err(Failure::new(Kind::Bus, reason)));
        }
        stderr::detach();
        panics::abort();
    }
    log(cli.quiet, cli.verbose);
    let done = match &cli.command {
        #[cfg(feature = "simulation")]
        Command::Bench(command) => command.execute(cli.quiet),
        Command::Rack(command) => command.execute(),
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
