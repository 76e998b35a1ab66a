//! `frhc export`: files for other tools: DBC and DCF of a configuration, a table or an MCAP file of a recorded session.

pub mod csv;
pub mod dbc;
pub mod dcf;
pub mod mcap;

use clap::Subcommand;

use run::exit::Failure;

/// `frhc export`.
#[derive(Debug, Subcommand)]
pub enum Export {
    /// Writes signals of a recorded session as a table, a row for each cycle.
    #[command(
        after_help = "Columns are the number of the cycle, the time in s since time zero, and the signals; `frhc signals SESSION` \
            lists these. A value that is absent is empty.\n\nExamples:\n  \
            frhc export csv /tmp/session -o all.csv\n  \
            frhc export csv /tmp/session q tau f_s.fx --every 10 --from 5s --to 8s | head"
    )]
    Csv(csv::Csv),
    /// Writes a DBC file of the buses, with SI scaling and joint names.
    #[command(
        after_help = "Examples:\n  frhc export dbc --config config/kraft_like.toml --out kraft_like.dbc\n  \
            cantools decode kraft_like.dbc < session/bus.log\n  \
            frhc export dbc --config config/jpl_like.toml --bus wrist | less"
    )]
    Dbc(dbc::Dbc),
    /// Writes a device configuration file (CiA 306) for each drive and the switch box.
    #[command(
        after_help = "Example:\n  frhc export dcf --config config/kraft_like_500hz.toml --out /tmp/dcf"
    )]
    Dcf(dcf::Dcf),
    /// Writes a recorded session as an MCAP file: ROS 2 messages for `ros2 bag`, `PlotJuggler`, Foxglove and Lichtblick.
    #[command(
        after_help = "Layouts of the viewers are in share/layouts. What only a replay has is left out where the session does not \
            replay, and a warning says so.\n\nExamples:\n  \
            frhc export mcap /tmp/session -o session.mcap\n  \
            frhc export mcap /tmp/session -o contact.mcap --from 4s --to 9s"
    )]
    Mcap(mcap::Mcap),
}

/// Executes the export; `is_quiet` hides the progress bar.
pub(super) fn run(export: &Export, is_quiet: bool) -> Result<(), Failure> {
    match export {
        Export::Csv(args) => csv::run(args, is_quiet),
        Export::Dbc(args) => dbc::run(args),
        Export::Dcf(args) => dcf::run(args),
        Export::Mcap(args) => mcap::run(args, is_quiet),
    }
}
