//! The command line: a contract with scripts; see the README.

use std::path::PathBuf;

use clap::ArgGroup;
use clap::Args;
use clap::Parser;
use clap::Subcommand;
use clap::ValueEnum;

use crate::cli::bench::words;
use crate::cli::calib::Calib;
use crate::cli::campaign::Campaign;
use crate::cli::commission::Commission;
use crate::cli::configured::Configured;
use crate::cli::configured::Guarded;
use crate::cli::decode::Decode;
use crate::cli::explain::Explain;
use crate::cli::export::Export;
use crate::cli::interfaces::Interfaces;
use crate::cli::lss::Lss;
use crate::cli::nmt::Nmt;
use crate::cli::personality::Personalities;
use crate::cli::plan::Plan;
use crate::cli::results::Force;
use crate::cli::rig::Calibrate;
use crate::cli::scan::Scan;
use crate::cli::sdo::Sdo;

/// The CANopen master of a force-reflecting hand controller.
#[derive(Debug, Parser)]
#[command(
    name = "frhc",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Every command has examples: frhc help decode. The exit codes are those of the README: 0 done, 1 answered no, \
                  2 command line, 3 configuration, 4 interface or file, 5 drive, 6 latched stop.\n\nExamples:\n  \
                  frhc demo\n  frhc check --config config/kraft_like.toml\n  frhc explain faults"
)]
pub(super) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(super) command: Command,
    /// Say less: errors only.
    #[arg(short, long, global = true)]
    pub(super) quiet: bool,
    /// Say more; twice for everything.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(super) verbose: u8,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(super) enum Command {
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
    /// The node on SocketCAN, until SIGINT or SIGTERM.
    #[command(
        after_help = "SIGINT and SIGTERM end it in order: torque to zero, drives off and confirmed, within a second. The \
                      configuration is read once, at the start; nothing reloads it, and SIGHUP is ignored. Every trip \
                      leaves a fault record, in faults/ of the recording or else in the user's state folder.\n\nExample:\n  \
                      frhc run --config config/kraft_like_500hz.toml -i can0 --record /var/lib/frhc"
    )]
    Run(Run),
    /// The simulated drives, switch box, arm and operator on SocketCAN, for `run` or any other master.
    #[command(
        after_help = "Prints what each drive believes at the end, and whenever it gets SIGUSR1 or SIGQUIT (Ctrl-\\ at a terminal).\n\nExamples:\n  \
                      frhc sim --config config/kraft_like_500hz.toml -i vcan0 --scenario contact_10s\n  \
                      frhc sim --config config/kraft_like.toml --json > drives.jsonl &\n  kill -USR1 $!"
    )]
    Sim(Sim),
    /// Talks to a running node over its Unix socket.
    #[command(
        after_help = "Examples:\n  frhc ctl --wait arm && frhc ctl status --json\n  frhc ctl disarm"
    )]
    Ctl(Ctl),
    /// Checks configuration, EDS files, calibration, bus load and gains; touches no bus.
    #[command(
        after_help = "Examples:\n  frhc check --config config/kraft_like.toml\n  frhc check --eds eds/frhc_drive.eds"
    )]
    Check(Check),
    /// Boots the drives and lets each show that it stops by itself when its master does.
    Commission(Commission),
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

/// `frhc demo`.
#[derive(Debug, Args)]
pub(super) struct Demo {
    /// The configuration.
    #[arg(short, long, value_name = "FILE", default_value = "config/kraft_like.toml")]
    pub(super) config: PathBuf,
    /// What the operator does and what breaks: a name as contact_10s or faults/unplug, or a file ending in .toml.
    #[arg(short, long, value_name = "NAME|FILE", default_value = "teleoperation")]
    pub(super) scenario: String,
    /// How long, in simulated seconds; the scenario's own length if not given.
    #[arg(long, value_name = "N", value_parser = words::seconds, allow_negative_numbers = true)]
    pub(super) seconds: Option<f64>,
    /// Seed of the operator's tremor.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// As fast as the clock on the wall, not faster.
    #[arg(long)]
    pub(super) realtime: bool,
    /// Leave bus.log (candump), summary.json and faults/ here; an earlier session is not written over.
    #[arg(short, long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) force: Force,
    /// The summary as one JSON object.
    #[arg(long)]
    pub(super) json: bool,
}

/// `frhc run`.
#[derive(Debug, Args)]
pub(super) struct Run {
    #[command(flatten)]
    pub(super) config: Guarded,
    #[command(flatten)]
    pub(super) interfaces: Interfaces,
    /// Leave bus.log (candump), summary.json and faults/ in a new folder of this one, NNN-UTC.
    #[arg(short, long, value_name = "DIR")]
    pub(super) record: Option<PathBuf>,
}

/// `frhc sim`.
#[derive(Debug, Args)]
pub(super) struct Sim {
    #[command(flatten)]
    pub(super) config: Configured,
    #[command(flatten)]
    pub(super) interfaces: Interfaces,
    /// What the operator does and what breaks: a name as contact_10s or faults/unplug, or a file ending in .toml.
    #[arg(short, long, value_name = "NAME|FILE", default_value = "free")]
    pub(super) scenario: String,
    /// Seed of the operator's tremor, or of the unknown torque curve.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// What each drive believes as one JSON object per line.
    #[arg(long, conflicts_with = "calibrate")]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) personalities: Personalities,
    #[command(flatten)]
    pub(super) rig: Calibrate,
}

/// `frhc ctl`.
#[derive(Debug, Args)]
pub(super) struct Ctl {
    /// What to ask.
    #[command(subcommand)]
    pub(super) request: CtlRequest,
    /// The node's socket; otherwise frhc/node.sock in $XDG_RUNTIME_DIR, then /run/frhc/node.sock, the service's.
    #[arg(long, value_name = "PATH", global = true)]
    pub(super) socket: Option<PathBuf>,
    /// The configuration that names the socket.
    #[arg(short, long, value_name = "FILE", global = true, conflicts_with = "socket")]
    pub(super) config: Option<PathBuf>,
    /// Waits until a node listens and its boot is over, for so many seconds at most.
    #[arg(
        long,
        value_name = "SECONDS",
        global = true,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "30",
        value_parser = clap::value_parser!(u64).range(1..=3_600)
    )]
    pub(super) wait: Option<u64>,
    /// The answer as one JSON object.
    #[arg(long, global = true)]
    pub(super) json: bool,
}

/// What to ask a node.
#[derive(Clone, Copy, Debug, Subcommand)]
pub(super) enum CtlRequest {
    /// Mode, torques, pose, counters.
    #[command(after_help = "Example:\n  frhc ctl status --json | jq .status.mode")]
    Status,
    /// Gravity compensation on; from now on the deadman engages.
    #[command(after_help = "Example:\n  frhc ctl arm && frhc ctl status")]
    Arm,
    /// Torque off.
    #[command(after_help = "Example:\n  frhc ctl disarm")]
    Disarm,
    /// Leave a latched stop, once its cause is gone.
    #[command(after_help = "Example:\n  frhc ctl reset && frhc ctl arm")]
    Reset,
    /// Command rates or poses.
    #[command(after_help = "Example:\n  frhc ctl mode pose")]
    Mode {
        /// Which.
        mode: CommandMode,
    },
}

/// What a displacement of the hand means.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum CommandMode {
    /// A velocity of the object.
    Rate,
    /// A pose of the object.
    Pose,
}

/// `frhc check`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("subject").required(true).args(["config", "eds"]))]
pub(super) struct Check {
    /// The configuration.
    #[arg(short, long, value_name = "FILE")]
    pub(super) config: Option<PathBuf>,
    /// An EDS or DCF, by itself: everything that is wrong with it, by line. Repeatable.
    #[arg(long, value_name = "FILE")]
    pub(super) eds: Vec<PathBuf>,
    /// The findings as one JSON object.
    #[arg(long)]
    pub(super) json: bool,
}
