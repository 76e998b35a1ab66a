//! Commands of the rack: dispatch and help.

use clap::Subcommand;

use crate::exit::Failure;
use crate::{check, commission, ctl, run, sessions};

/// Commands that the rack needs.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Runs the node on SocketCAN until SIGINT or SIGTERM.
    #[command(
        after_help = "SIGINT and SIGTERM stop the node in order: torque ramps to zero, then the drives are disabled and \
            confirm it, within a second. The configuration is read once, at the start; SIGHUP is ignored. Every \
            trip leaves a fault record: in faults/ of the recording, or else in the user's state folder.\n\nExample:\n  \
            frhc run --config config/kraft_like_500hz.toml -i can0 --record /var/lib/frhc"
    )]
    Run(run::Run),
    /// Sends one request to a running node over its Unix socket: status, arm, disarm, reset, mode.
    #[command(
        after_help = "Examples:\n  frhc ctl --wait arm && frhc ctl status --json\n  frhc ctl disarm"
    )]
    Ctl(ctl::Ctl),
    /// Checks a configuration (EDS files, calibration, bus load, gains) or an EDS; opens no bus.
    #[command(
        after_help = "Examples:\n  frhc check --config config/kraft_like.toml\n  frhc check --eds eds/frhc_drive.eds"
    )]
    Check(check::Check),
    /// Boots the drives and tests that each one stops by its own timers when its master is lost.
    Commission(commission::Commission),
    /// Lists recorded sessions, and packs them.
    #[command(
        subcommand,
        after_help = "Examples:\n  frhc sessions list /var/lib/frhc\n  frhc sessions pack /var/lib/frhc"
    )]
    Sessions(sessions::Sessions),
}

impl Command {
    /// Executes the command.
    ///
    /// # Errors
    /// Returns the failure, with its exit code.
    pub fn execute(&self) -> Result<(), Failure> {
        match self {
            Self::Run(args) => run::run(args),
            Self::Ctl(args) => ctl::run(args),
            Self::Check(args) => check::run(args),
            Self::Commission(args) => commission::run(args),
            Self::Sessions(command) => sessions::run(command),
        }
    }

    /// Returns whether this is `run`, which must stop the drives in order before it ends.
    pub const fn is_run(&self) -> bool {
        matches!(self, Self::Run(_))
    }
}
