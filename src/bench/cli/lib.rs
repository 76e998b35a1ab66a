//! Commands that the rack does not need: simulation, tools for a live bus, and offline tools for logs and configurations.
#![forbid(unsafe_code)]

pub mod args;
pub mod calib;
pub mod campaign;
pub mod config;
pub mod decode;
pub mod explain;
pub mod export;
mod faults;
pub mod live_bus;
pub mod lss;
pub mod nmt;
mod os_signals;
pub mod plan;
pub mod plot;
mod quirks;
pub mod replay;
pub mod report;
mod rig;
mod robot;
pub mod scan;
pub mod sdo;
mod session_config;
mod session_progress;
pub mod signal_list;
mod sim;
mod span;
pub mod top;
mod whole_file;

use clap::Subcommand;

use crate::args::{Robot, Sim};
use crate::calib::Calib;
use crate::campaign::Campaign;
use crate::config::ConfigArgs;
use crate::decode::Decode;
use crate::explain::Explain;
use crate::export::Export;
use crate::lss::Lss;
use crate::nmt::Nmt;
use crate::plan::Plan;
use crate::plot::Plot;
use crate::replay::ReplayArgs;
use crate::report::ReportArgs;
use crate::scan::Scan;
use crate::sdo::Sdo;
use crate::signal_list::SignalList;
use crate::top::Top;
use measure::command::{self as measure_command, MeasureArgs};
use run::exit::Failure;
use view::command::{self as view_command, View};

/// Commands that the rack does not need.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Injects many faults, one per simulated run, and checks the node's reaction to each.
    #[command(
        after_help = "The exit code is 1 when a fault was missed or detected late, a rule of the bus was violated, or the node \
            stopped without need. --replay runs such a case again and leaves its session, for `frhc replay`.\n\nExamples:\n  \
            frhc campaign --seed 1 --faults 2000\n  \
            frhc campaign --seed 1 --replay 137 --out /tmp/137\n  \
            frhc campaign --seed 1 --faults 60 --verify-replay\n  \
            frhc campaign --seed 1 --soak 1000000"
    )]
    Campaign(Campaign),
    /// Simulates the drives, switch box, arm and operator on SocketCAN, for `run` or any other master.
    #[command(
        after_help = "Prints the state of each drive at the end, and on SIGUSR1 or SIGQUIT (Ctrl-\\ at a terminal).\n\nExamples:\n  \
            frhc sim --config config/kraft_like_500hz.toml -i vcan0 --scenario contact_10s\n  \
            frhc sim --config config/kraft_like.toml --json > drives.jsonl &\n  kill -USR1 $!"
    )]
    Sim(Sim),
    /// Simulates the robot that a node commands over a Unix socket: the far side of docs/link.md.
    #[command(
        after_help = "Connects to the socket of `frhc run`, and again after each end of the connection. Prints its status at the \
            end, and on SIGUSR1 or SIGQUIT (Ctrl-\\ at a terminal).\n\nExamples:\n  \
            frhc robot --config config/kraft_like.toml --robot config/robots/puma560.toml --socket /run/frhc/far.sock\n  \
            frhc robot --config my_robot.toml --robot config/robots/puma560.toml --bias"
    )]
    Robot(Robot),
    /// Plans the buses of a configuration: frames and worst-case response times, cycle timeline, load, maximum rate, loop
    /// delay; proposes changes if it does not fit.
    #[command(
        after_help = "Examples:\n  frhc plan --config config/kraft_like.toml\n  frhc plan --config config/kraft_like_500hz.toml --rate 1000 --layout grouped --json | jq .fits"
    )]
    Plan(Plan),
    /// Computes one controller cycle and prints every intermediate value (Fig. 3 of the paper).
    #[command(
        after_help = "Examples:\n  frhc explain --q 0.05,-0.8,1.6,-0.7,0.1,0.2 --q-reference 0,-0.87,1.66,-0.79,0,0 --wrench -5,0,0,0,0,0\n  echo '{\"q\": [0,-0.8,1.6,-0.7,0,0], \"preset\": \"paper1997\"}' | frhc explain --json - | jq .tau.value\n  frhc explain --q 0,-0.8,1.6,-0.7,0,0 --set 'controller.rate_gain_per_s=[1,1,1,2,2,2]'\n  frhc explain robot config/robots/puma560.toml --q 0,0.8,-3.1,0,0.8,0"
    )]
    Explain(Box<Explain>),
    /// Fits torque curves to measurements, or checks those of a configuration.
    #[command(
        after_help = "Examples:\n  frhc sim --config config/kraft_like.toml --calibrate elbow --out elbow.csv\n  \
            frhc calib fit elbow.csv --config config/kraft_like.toml\n  \
            frhc calib check --config config/kraft_like.toml"
    )]
    Calib(Calib),
    /// Measures facts of an arm that a configuration states, at the arm.
    #[command(after_help = "Example:\n  frhc measure direction --config my_arm.toml")]
    Measure(MeasureArgs),
    /// Changes a configuration file, with its comments, order and format kept.
    #[command(
        after_help = "Example:\n  frhc config merge my_arm.toml elbow/torque_curves.toml sweep/friction.toml"
    )]
    Config(ConfigArgs),
    /// Lists the nodes on a bus: identity, NMT state, and whether the configuration expects them.
    Scan(Scan),
    /// Reads or writes one object of one node.
    Sdo(Sdo),
    /// Sends NMT commands, or shows NMT states, heartbeats and emergencies.
    Nmt(Nmt),
    /// Sets node-ids and bit rates of devices by LSS (CiA 305).
    Lss(Lss),
    /// Annotates a candump log by joint and in SI units.
    #[command(
        after_help = "Each line is printed unchanged, followed by its meaning. Anomalies follow a `!`: a missing or late frame, \
            a wrong length, a timestamp that goes back. Lines in another format pass unchanged; the first ones \
            are reported on stderr. The exit code is 1 when no line is a candump line.\n\nExamples:\n  \
            frhc decode --config config/kraft_like.toml /tmp/session/bus.log | less -S\n  \
            candump -ta can0 | frhc decode --config config/kraft_like_500hz.toml -i can0 --only elbow\n  \
            frhc decode --config config/kraft_like.toml --json bus.log | jq 'select(.remarks)'"
    )]
    Decode(Decode),
    /// Shows a running node in this terminal: joints, forces, mode and cause, timing, buses, watchdogs.
    #[command(
        after_help = "Reads the node's telemetry, and sends it nothing. Waits for a node, and for the next one. Keys: q quits, p pauses, \
            b shows the torque budget.\n\nExamples:\n  frhc top\n  ssh -t rack frhc top\n  \
            frhc top --once --socket /run/frhc-view/telemetry.sock"
    )]
    Top(Top),
    /// Computes a recorded session again from its inputs, and compares every frame that the node sends.
    #[command(
        after_help = "A session is a folder of `frhc run --record`, `frhc demo --out` or `frhc campaign --replay`. It needs neither \
            drives nor robot. Cycles have the numbers of bus.log. The exit code is 1 where a frame differs.\n\nExamples:\n  \
            frhc replay sessions/001-20261122T071243Z --verify\n  \
            frhc replay sessions/001-20261122T071243Z/faults/001-4213-samples-missing\n  \
            frhc replay /tmp/session --emit sent.log --from 4000 --to 4100"
    )]
    Replay(ReplayArgs),
    /// Draws signals of a recorded session over time, or writes them as a table.
    #[command(
        after_help = "A quantity has a plot for each of its units; a curve shows smallest and largest value of each pixel. Modes \
            and stops are above.\n\nExamples:\n  \
            frhc plot /tmp/session f_s f_g_task -o felt.svg\n  \
            frhc plot /tmp/session '*.elbow' --from 5s --to 8s -o elbow.svg"
    )]
    Plot(Plot),
    /// Lists the signals of a recorded session, with unit and frame.
    #[command(
        after_help = "Signals are what `frhc plot` and `frhc export csv` take. Those of the replay need its inputs.\n\nExamples:\n  \
            frhc signals /tmp/session | less\n  frhc signals --json | jq -r .name"
    )]
    Signals(SignalList),
    /// Writes what happened in a recorded session as one page for people: HTML, without a script.
    #[command(
        after_help = "SESSION is a folder of `frhc run --record` or `frhc demo --out`, or a fault record. What cannot be read is \
            said in the report, and the rest is done.\n\nExamples:\n  \
            frhc report sessions/001-20261122T071243Z\n  \
            frhc report /tmp/a --compare /tmp/b -o comparison.html\n  \
            frhc report sessions/001-20261122T071243Z/faults/001-4213-samples-missing -o fault.html"
    )]
    Report(ReportArgs),
    /// Shows a running node in a browser: arm, robot, forces, mode and timing. Only looks.
    #[command(
        after_help = "Prints the address of the page and serves it until Ctrl-C. It connects to the node's telemetry socket, and again \
            whenever the node comes back.\n\nExamples:\n  frhc view\n  \
            frhc view --listen 127.0.0.1:8021 --socket /run/frhc-view/telemetry.sock"
    )]
    View(View),
    /// Writes a DBC file of the buses, DCF files of the nodes, or a table or MCAP file of a recorded session.
    #[command(
        subcommand,
        after_help = "Examples:\n  frhc export dbc --config config/kraft_like.toml --out kraft_like.dbc\n  \
            frhc export dcf --config config/kraft_like_500hz.toml --out /tmp/dcf\n  \
            frhc export csv /tmp/session q tau\n  \
            frhc export mcap /tmp/session --out /tmp/session.mcap"
    )]
    Export(Export),
}

impl Command {
    /// Executes the command; `is_quiet` hides the progress bar.
    ///
    /// # Errors
    /// Returns the failure, with its exit code.
    pub fn execute(&self, is_quiet: bool) -> Result<(), Failure> {
        match self {
            Self::Campaign(args) => campaign::run(args, is_quiet),
            Self::Sim(args) => sim::run(args),
            Self::Robot(args) => robot::run(args),
            Self::Plan(args) => plan::run(args),
            Self::Explain(args) => explain::run(args),
            Self::Calib(args) => calib::run(args),
            Self::Config(args) => config::run(args),
            Self::Scan(args) => scan::run(args),
            Self::Sdo(args) => sdo::run(args),
            Self::Nmt(args) => nmt::run(args),
            Self::Lss(args) => lss::run(args),
            Self::Decode(args) => decode::run(args, is_quiet),
            Self::Measure(args) => measure_command::run(args),
            Self::Top(args) => top::run(args),
            Self::Replay(args) => replay::run(args, is_quiet),
            Self::Plot(args) => plot::run(args, is_quiet),
            Self::Report(args) => report::run(args, is_quiet),
            Self::Signals(args) => signal_list::run(args),
            Self::View(args) => view_command::execute(args),
            Self::Export(args) => export::run(args, is_quiet),
        }
    }
}
