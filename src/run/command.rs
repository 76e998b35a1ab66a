//! The commands of the rack.

use clap::Subcommand;

use crate::check;
use crate::commission;
use crate::ctl;
use crate::exit::Failure;
use crate::run;

/// What the rack's program does.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// The node on SocketCAN, until SIGINT or SIGTERM.
    #[command(
        after_help = "SIGINT and SIGTERM end it in order: torque to zero, drives off and confirmed, within a second. The \
                      configuration is read once, at the start; nothing reloads it, and SIGHUP is ignored. Every trip \
                      leaves a fault record, in faults/ of the recording or else in the user's state folder.\n\nExample:\n  \
                      frhc run --config config/kraft_like_500hz.toml -i can0 --record /var/lib/frhc"
    )]
    Run(run::Run),
    /// Talks to a running node over its Unix socket.
    #[command(
        after_help = "Examples:\n  frhc ctl --wait arm && frhc ctl status --json\n  frhc ctl disarm"
    )]
    Ctl(ctl::Ctl),
    /// Checks configuration, EDS files, calibration, bus load and gains; touches no bus.
    #[command(
        after_help = "Examples:\n  frhc check --config config/kraft_like.toml\n  frhc check --eds eds/frhc_drive.eds"
    )]
    Check(check::Check),
    /// Boots the drives and lets each show that it stops by itself when its master does.
    Commission(commission::Commission),
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// What failed, and the exit code of its kind.
    pub fn execute(&self) -> Result<(), Failure> {
        match self {
            Self::Run(args) => run::run(args),
            Self::Ctl(args) => ctl::run(args),
            Self::Check(args) => check::run(args),
            Self::Commission(args) => commission::run(args),
        }
    }

    /// Whether it is the one that must not end out of order.
    pub const fn is_run(&self) -> bool {
        matches!(self, Self::Run(_))
    }
}
