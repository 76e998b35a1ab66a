//! What the rack does without: demo, campaign and simulated drives, tools for a bus, files in words.

mod args;
pub mod bench;
mod calib;
mod campaign;
mod decode;
mod demo;
mod explain;
mod export;
mod interrupt;
mod lss;
mod nmt;
mod plan;
mod quirks;
mod rig;
mod scan;
mod scenario;
mod sdo;
mod sim;
mod story;

use clap::Subcommand;

use crate::cli::args::Demo;
use crate::cli::args::Sim;
use crate::cli::calib::Calib;
use crate::cli::campaign::Campaign;
use crate::cli::decode::Decode;
use crate::cli::explain::Explain;
use crate::cli::export::Export;
use crate::cli::lss::Lss;
use crate::cli::nmt::Nmt;
use crate::cli::plan::Plan;
use crate::cli::scan::Scan;
use crate::cli::sdo::Sdo;
use run::exit::Failure;

/// What there is beside the rack's commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Everything in one process: node, six simulated drives, operator and a virtual object.
    #[command(after_help = "Examples:\n  frhc demo --scenario faults/unplug\n  \
                      frhc demo --seconds 20 --out /tmp/session && log2asc -I /tmp/session/bus.log vcan0 vcan1")]
    Demo(Demo),
    /// Many faults, each alone, in one process and virtual time, and what came of each.
    #[command(
        after_help = "The exit code is 1 when a fault was missed, a law of the bus was broken or the node stopped without need. \
                      Each such case can be played again by itself, and leaves its log.\n\nExamples:\n  \
                      frhc campaign --seed 1 --faults 2000\n  \
                      frhc campaign --seed 1 --replay 137 --out /tmp/137\n  \
                      frhc campaign --seed 1 --soak 1000000"
    )]
    Campaign(Campaign),
    /// The simulated drives, switch box, arm and operator on SocketCAN, for `run` or any other master.
    #[command(
        after_help = "Prints what each drive believes at the end, and whenever it gets SIGUSR1 or SIGQUIT (Ctrl-\\ at a terminal).\n\nExamples:\n  \
                      frhc sim --config config/kraft_like_500hz.toml -i vcan0 --scenario contact_10s\n  \
                      frhc sim --config config/kraft_like.toml --json > drives.jsonl &\n  kill -USR1 $!"
    )]
    Sim(Sim),
    /// What the buses will carry: every frame and its response, a cycle's timeline, load, highest rate,
    /// loop delay; and what would fit where this does not.
    #[command(
        after_help = "Examples:\n  frhc plan --config config/kraft_like.toml\n  frhc plan --config config/kraft_like_500hz.toml --rate 1000 --layout grouped --json | jq .fits"
    )]
    Plan(Plan),
    /// One cycle of the controller, with every intermediate of the paper's Fig. 3.
    #[command(
        after_help = "Examples:\n  frhc explain --q 0.05,-0.8,1.6,-0.7,0.1,0.2 --q-reference 0,-0.87,1.66,-0.79,0,0 --wrench -5,0,0,0,0,0\n  echo '{\"q\": [0,-0.8,1.6,-0.7,0,0], \"preset\": \"paper1997\"}' | frhc explain --json - | jq .tau.value\n  frhc explain '{\"q\": [0,-0.8,1.6,-0.7,0,0], \"rate_gain\": [1,1,1,2,2,2]}'"
    )]
    Explain(Box<Explain>),
    /// Torque curves from measurements, and those of a configuration.
    #[command(
        after_help = "Examples:\n  frhc sim --config config/kraft_like.toml --calibrate elbow --out elbow.csv\n  \
                      frhc calib fit elbow.csv --config config/kraft_like.toml\n  \
                      frhc calib check --config config/kraft_like.toml"
    )]
    Calib(Calib),
    /// Who is on a bus: identity, state, and what the configuration says of it.
    Scan(Scan),
    /// Reads or writes one object of one node.
    Sdo(Sdo),
    /// Starts, stops and resets nodes, and tells what is heard of them.
    Nmt(Nmt),
    /// Sets node-ids and bit rates of devices.
    Lss(Lss),
    /// What candump lines say, by joint and in SI units: behind each line, as it was.
    #[command(
        after_help = "Behind a `!` stands what is missing, late or of the wrong length, and a stamp that goes back. Other lines \
                      pass as they are; the first of them are reported on stderr, and the exit code is 1 when no \
                      line is candump's.\n\nExamples:\n  \
                      frhc decode --config config/kraft_like.toml /tmp/session/bus.log | less -S\n  \
                      candump -ta can0 | frhc decode --config config/kraft_like_500hz.toml -i can0 --only elbow\n  \
                      frhc decode --config config/kraft_like.toml --json bus.log | jq 'select(.remarks)'"
    )]
    Decode(Decode),
    /// Files for other programs: the frames of the buses, what each node is left with.
    #[command(
        subcommand,
        after_help = "Examples:\n  frhc export dbc --config config/kraft_like.toml --out kraft_like.dbc\n  \
                      frhc export dcf --config config/kraft_like_500hz.toml --out /tmp/dcf"
    )]
    Export(Export),
}

impl Command {
    /// Does it; `is_quiet` leaves progress out.
    pub(crate) fn execute(&self, is_quiet: bool) -> Result<(), Failure> {
        match self {
            Self::Demo(args) => demo::run(args, is_quiet),
            Self::Campaign(args) => campaign::run(args, is_quiet),
            Self::Sim(args) => sim::run(args),
            Self::Plan(args) => plan::run(args),
            Self::Explain(args) => explain::run(args),
            Self::Calib(args) => calib::run(args),
            Self::Scan(args) => scan::run(args),
            Self::Sdo(args) => sdo::run(args),
            Self::Nmt(args) => nmt::run(args),
            Self::Lss(args) => lss::run(args),
            Self::Decode(args) => decode::run(args, is_quiet),
            Self::Export(args) => export::run(args),
        }
    }
}
