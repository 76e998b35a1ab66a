//! The process: command line, log and exit code.

use std::io::Write;
use std::process::ExitCode;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use tracing_subscriber::filter::LevelFilter;

mod help;

use run::exit::{Failure, Kind};
use run::log_time::TimestampedWriter;
use run::{one_arena, panics, print, stderr, stop_signals};

const EXAMPLES: &str = if cfg!(feature = "simulation") {
    "`frhc help COMMAND` shows examples of a command.\n\nExit codes: 0 success, 1 negative result, 2 usage, 3 invalid \
     configuration, 4 interface or file, 5 drive, 6 latched stop.\n\nExamples:\n  \
    frhc demo\n  frhc check --config config/kraft_like.toml\n  frhc explain faults"
} else {
    "`frhc help COMMAND` shows examples of a command.\n\nExit codes: 0 success, 1 negative result, 2 usage, 3 invalid \
     configuration, 4 interface or file, 5 drive, 6 latched stop.\n\nExamples:\n  \
    frhc check --config config/kraft_like.toml\n  frhc ctl status"
};

/// CANopen master and controller of a six-jointed force-reflecting hand controller.
#[derive(Debug, Parser)]
#[command(
    name = "frhc",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = EXAMPLES
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    log: LogArgs,
}

/// Options of the log on stderr.
#[derive(Clone, Copy, Debug, Args)]
pub struct LogArgs {
    /// Log errors only.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Log more: -v debug, -vv trace.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

/// The commands of the program.
#[derive(Debug, Subcommand)]
enum Command {
    /// Runs node, simulated drives, operator and remote side in one process; opens no bus.
    #[cfg(feature = "demo")]
    #[command(after_help = "Examples:\n  frhc demo --scenario faults/unplug\n  \
        frhc demo --seconds 20 --out /tmp/session && log2asc -I /tmp/session/bus.log vcan0 vcan1")]
    Demo(demo::args::Demo),
    #[cfg(feature = "simulation")]
    #[command(flatten)]
    Bench(cli::Command),
    #[command(flatten)]
    Rack(run::command::Command),
}

/// Runs the program with the process's arguments.
pub fn main() -> ExitCode {
    let given = help::in_groups(Cli::command()).try_get_matches();
    let cli = match given.and_then(|given| Cli::from_arg_matches(&given)) {
        Ok(cli) => cli,
        Err(error) => return print_usage(&error),
    };
    if matches!(&cli.command, Command::Rack(command) if command.is_run()) {
        one_arena::begin();
        if let Err(error) = stop_signals::block() {
            let reason = format!("cannot block signals: {error}");
            return conclude(Err(Failure::new(Kind::System, reason)));
        }
        if let Err(error) = stderr::detach() {
            let reason = format!("cannot start thread frhc-stderr: {error}");
            return conclude(Err(Failure::new(Kind::System, reason)));
        }
        panics::abort();
    }
    init_log(cli.log);
    let done = match &cli.command {
        #[cfg(feature = "demo")]
        Command::Demo(args) => demo::run(args, cli.log.quiet),
        #[cfg(feature = "simulation")]
        Command::Bench(command) => command.execute(cli.log.quiet),
        Command::Rack(command) => command.execute(),
    };
    let code = conclude(done);
    stderr::flush();
    code
}

/// Prints the failures of the command and of its output; returns the exit code of the first.
pub fn conclude(done: Result<(), Failure>) -> ExitCode {
    let failures = [done, print::finish()].map(Result::err);
    let failures: Vec<Failure> = failures.into_iter().flatten().collect();
    failures.iter().for_each(|failure| print::error(&failure.to_string()));
    failures.first().map_or(ExitCode::SUCCESS, Failure::code)
}

/// Prints help or version on stdout, or the usage error on stderr.
pub fn print_usage(error: &clap::Error) -> ExitCode {
    if error.use_stderr() {
        let styled = error.render();
        let text = if has_colour() { styled.ansi().to_string() } else { styled.to_string() };
        print::note(for_engineers(text).trim_end());
        return ExitCode::from(2);
    }
    print::record_result(error.print());
    conclude(Ok(()))
}

/// Replaces the reasons of the standard library for a number that cannot be parsed.
fn for_engineers(text: String) -> String {
    const REASONS: [(&str, &str); 6] = [
        ("invalid socket address syntax", "expected ADDRESS:PORT, as 127.0.0.1:8020"),
        ("invalid digit found in string", "expected a whole number, 0 or above"),
        ("cannot parse integer from empty string", "expected a whole number"),
        ("number too large to fit in target type", "the number is too large"),
        ("number would be zero for non-zero type", "must be at least 1, got 0"),
        ("invalid float literal", "expected a number"),
    ];
    REASONS.iter().fold(text, |text, (theirs, ours)| text.replace(theirs, ours))
}

/// Returns whether stderr shows colours.
fn has_colour() -> bool {
    std::env::var_os("NO_COLOR").is_none() && std::io::IsTerminal::is_terminal(&std::io::stderr())
}

/// Sets up the log on stderr; `-q` leaves errors only, `-v` adds detail.
pub fn init_log(log: LogArgs) {
    let level = match (log.quiet, log.verbose) {
        (true, _) => LevelFilter::ERROR,
        (false, 0) => LevelFilter::INFO,
        (false, 1) => LevelFilter::DEBUG,
        (false, _) => LevelFilter::TRACE,
    };
    tracing_subscriber::fmt()
        .with_writer(|| {
            let stderr: Box<dyn Write> = match stderr::queue() {
                Some(queue) => Box::new(queue),
                None => Box::new(std::io::stderr()),
            };
            TimestampedWriter(stderr)
        })
        .with_max_level(level)
        .with_target(false)
        .with_ansi(has_colour())
        .without_time()
        .init();
}

#[cfg(all(test, feature = "simulation"))]
mod tests;
