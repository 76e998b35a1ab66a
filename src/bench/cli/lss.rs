//! `frhc lss`: sets node-ids and bit rates over the bus (CiA 305). This file has the arguments.

mod execute;

use std::time::Duration;

use clap::{Args, Subcommand};

use crate::live_bus::{BusArgs, ForceArg, NodeArg, SelectedBus, node_arg, parsers};
use canopen::NodeId;
use canopen_device::lss::{Address, BitRate};
use canopen_tools::lss::identify::Description;
use canopen_tools::lss::job::{Job, Selection};
use run::exit::{Failure, Kind};

/// `frhc lss`.
#[derive(Debug, Args)]
#[command(
    after_help = "`configure` does all steps in one call and always leaves every slave in state waiting. The other commands \
        are single services: the slave stays selected (state configuration) until `deselect` or a failure.\n\n\
        Commands that select or set are refused while a master sends SYNC, unless --force is given.\n\n\
        A new node-id takes effect after `frhc nmt reset-comm`; on a slave without node-id at once.\n\n\
        Examples:\n  frhc lss fastscan -i can0\n  \
        frhc lss configure --select 0xF8C,0x04020010,0x00010000,3 --node-id 3 --store -i can0\n  \
        frhc lss configure --fastscan --node-id 4 --bit-timing 1000 --store -i can0"
)]
pub struct Lss {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    bus: BusArgs,
    /// Time allowed for a response of a slave; at least 1 s for storing.
    #[arg(long, value_name = "MS", default_value_t = 100, global = true,
        value_parser = clap::value_parser!(u64).range(1..=600_000))]
    timeout: u64,
    #[command(flatten)]
    force: ForceArg,
    /// Print the result as one JSON object.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Reads identity and node-id of the only slave on the bus, or of the chosen one; then deselects.
    #[command(after_help = "Example:\n  frhc lss inquire -i can0")]
    Inquire {
        #[command(flatten)]
        choice: Choice,
        /// Ask the slave that is already selected, and leave it selected.
        #[arg(long, conflicts_with_all = ["select", "fastscan", "global", "probe"])]
        selected: bool,
    },
    /// Selects the slave with this identity (switch state selective); it stays selected.
    #[command(after_help = "Example:\n  frhc lss select 0xF8C 0x04020010 0x00010000 3 -i can0")]
    Select {
        /// Vendor-ID, 1018h:1.
        #[arg(value_parser = parsers::number)]
        vendor: u32,
        /// Product code, 1018h:2.
        #[arg(value_parser = parsers::number)]
        product: u32,
        /// Revision number, 1018h:3.
        #[arg(value_parser = parsers::number)]
        revision: u32,
        /// Serial number, 1018h:4.
        #[arg(value_parser = parsers::number)]
        serial: u32,
    },
    /// Switches all slaves to state waiting.
    #[command(after_help = "Example:\n  frhc lss deselect -i can0")]
    Deselect,
    /// Sets the node-id of the selected slave; takes effect after a reset of communication.
    #[command(after_help = "Example:\n  frhc lss set-node-id 4 -i can0")]
    SetNodeId {
        /// Node-id 1 to 127, with a configuration also the name of a joint; none or 255 removes it.
        #[arg(value_parser = node_arg::node_or_none)]
        node: Node,
    },
    /// Sets the bit rate of the selected slave; takes effect after `activate`.
    #[command(after_help = "Example:\n  frhc lss set-bit-timing 500 -i can0")]
    SetBitTiming {
        /// Bit rate in kbit/s: 1000, 800, 500, 250, 125, 50, 20 or 10.
        #[arg(value_name = "KBIT", value_parser = bit_rate)]
        rate: BitRate,
    },
    /// Activates the new bit rate of the selected slaves; the bit rate of this interface stays.
    #[command(after_help = "Example:\n  frhc lss activate 1000 -i can0")]
    Activate {
        /// Switch delay: slaves stop sending, switch after this time, and send again after the same time.
        #[arg(value_name = "DELAY_MS")]
        delay: u16,
    },
    /// Stores node-id and bit rate of the selected slave in non-volatile memory.
    #[command(after_help = "Example:\n  frhc lss store -i can0")]
    Store,
    /// Finds the identity of one slave without node-id; then deselects.
    #[command(after_help = "Example:\n  frhc lss fastscan --probe 5 -i can0")]
    Fastscan {
        #[command(flatten)]
        probe: Probe,
    },
    /// Checks whether a slave within these identity ranges is present.
    #[command(
        after_help = "Example:\n  frhc lss identify-remote 0xF8C 0x04020010 0 0xFFFFFFFF 0 0xFFFFFFFF -i can0"
    )]
    IdentifyRemote {
        /// Vendor-ID, product code, lowest and highest revision number, lowest and highest serial number.
        #[arg(value_names = ["VENDOR", "PRODUCT", "REVISION", "REVISION", "SERIAL", "SERIAL"], num_args = 6,
            value_parser = parsers::number)]
        numbers: Vec<u32>,
    },
    /// Checks whether a slave without node-id is present.
    #[command(after_help = "Example:\n  frhc lss identify-non-configured -i can0")]
    IdentifyNonConfigured,
    /// Selects a slave, sets node-id or bit rate, stores them, and deselects.
    #[command(after_help = "Example:\n  frhc lss configure --fastscan --node-id 4 --store -i can0")]
    Configure {
        #[command(flatten)]
        choice: Choice,
        /// Confirm for --global that only one slave is on the bus; responses of several can look like one.
        #[arg(long)]
        yes: bool,
        /// New node-id 1 to 127, with a configuration also the name of a joint; none or 255 removes it.
        #[arg(long, value_name = "N", value_parser = node_arg::node_or_none, required_unless_present = "bit_timing")]
        node_id: Option<Node>,
        /// New bit rate in kbit/s.
        #[arg(long, value_name = "KBIT", value_parser = bit_rate)]
        bit_timing: Option<BitRate>,
        /// Store both in non-volatile memory.
        #[arg(long)]
        store: bool,
    },
}

/// Node-id, or `None` to remove it. With the alias clap does not treat the argument as optional.
type Node = Option<NodeArg>;

/// Choice of the slave.
#[derive(Debug, Args)]
struct Choice {
    /// Select the slave with this identity.
    #[arg(long, value_name = "VENDOR,PRODUCT,REVISION,SERIAL", value_parser = address, group = "choice")]
    select: Option<Address>,
    /// Select a slave without node-id by LSS fastscan.
    #[arg(long, group = "choice")]
    fastscan: bool,
    /// Time allowed for each of the 133 fastscan requests.
    #[arg(long, value_name = "MS", default_value_t = 20, requires = "fastscan",
        conflicts_with_all = ["select", "global"],
        value_parser = clap::value_parser!(u64).range(1..=10_000))]
    probe: u64,
    /// Select every slave (switch state global); for a bus with only one.
    #[arg(long, group = "choice")]
    global: bool,
}

/// Timing of a fastscan.
#[derive(Clone, Copy, Debug, Args)]
struct Probe {
    /// Time allowed for each of the 133 fastscan requests.
    #[arg(long, value_name = "MS", default_value_t = 20,
        value_parser = clap::value_parser!(u64).range(1..=10_000))]
    probe: u64,
}

impl Task {
    /// Returns the node whose node-id is to be set.
    const fn node(&self) -> Option<&NodeArg> {
        match self {
            Self::SetNodeId { node } | Self::Configure { node_id: Some(node), .. } => node.as_ref(),
            Self::Inquire { .. }
            | Self::Select { .. }
            | Self::Deselect
            | Self::SetBitTiming { .. }
            | Self::Activate { .. }
            | Self::Store
            | Self::Fastscan { .. }
            | Self::IdentifyRemote { .. }
            | Self::IdentifyNonConfigured
            | Self::Configure { node_id: None, .. } => None,
        }
    }

    /// Returns the time allowed for each fastscan request; zero without a fastscan.
    const fn probe(&self) -> Duration {
        let millis = match self {
            Self::Inquire { choice, .. } | Self::Configure { choice, .. } => choice.probe,
            Self::Fastscan { probe } => probe.probe,
            Self::Select { .. }
            | Self::Deselect
            | Self::SetNodeId { .. }
            | Self::SetBitTiming { .. }
            | Self::Activate { .. }
            | Self::Store
            | Self::IdentifyRemote { .. }
            | Self::IdentifyNonConfigured => 0,
        };
        Duration::from_millis(millis)
    }
}

impl Choice {
    /// Returns the selection; without any option every slave.
    fn selection(&self) -> Selection {
        match (self.select, self.fastscan) {
            (Some(address), _) => Selection::Address(address),
            (None, true) => Selection::Fastscan,
            (None, false) => Selection::All,
        }
    }

    /// Returns an error unless the choice is explicit and confirmed to be one slave.
    fn ensure_single(&self, is_confirmed: bool) -> Result<(), Failure> {
        if !self.global && !self.fastscan && self.select.is_none() {
            Err(usage("no slave selected: give --select, --fastscan or --global"))
        } else if self.global && !is_confirmed {
            Err(usage("--global configures every slave on the bus: add --yes if there is only one"))
        } else {
            Ok(())
        }
    }
}

/// Parses `VENDOR,PRODUCT,REVISION,SERIAL`.
fn address(text: &str) -> Result<Address, String> {
    let numbers: Vec<u32> = text.split(',').map(parsers::number).collect::<Result<_, _>>()?;
    let &[vendor, product, revision, serial] = numbers.as_slice() else {
        return Err("expected four numbers VENDOR,PRODUCT,REVISION,SERIAL".to_owned());
    };
    Ok(Address { vendor, product, revision, serial })
}

fn bit_rate(text: &str) -> Result<BitRate, String> {
    let rate = text.parse().ok().and_then(BitRate::of_kilobits);
    rate.ok_or_else(|| "must be 1000, 800, 500, 250, 125, 50, 20 or 10 kbit/s".to_owned())
}

/// Execution plan of a task.
enum Plan {
    /// Configure or inquire one slave.
    Configure(Job),
    /// Checks whether slaves in these identity ranges, or `None` for slaves without node-id, are present.
    Identify(Option<Description>),
}

/// Executes one task.
pub(super) fn run(args: &Lss) -> Result<(), Failure> {
    let bus = args.bus.select_for(args.task.node())?;
    match plan(&args.task, &bus)? {
        Plan::Identify(description) => execute::identify(args, &bus, description),
        Plan::Configure(job) => execute::run_job(args, &bus, job),
    }
}

/// Returns the plan of a task. `configure` requires an explicit choice: several slaves must not get the same node-id.
fn plan(task: &Task, bus: &SelectedBus) -> Result<Plan, Failure> {
    let selected = Job { release: false, ..Job::new(Selection::Selected) };
    let inquire = Job { inquire: true, ..selected };
    Ok(Plan::Configure(match task {
        Task::IdentifyNonConfigured => return Ok(Plan::Identify(None)),
        Task::IdentifyRemote { numbers } => {
            let &[vendor, product, r0, r1, s0, s1] = numbers.as_slice() else {
                return Err(usage("expected VENDOR PRODUCT REVISION REVISION SERIAL SERIAL"));
            };
            let (revision, serial) = ([r0, r1], [s0, s1]);
            return Ok(Plan::Identify(Some(Description { vendor, product, revision, serial })));
        }
        Task::Inquire { selected: true, .. } => inquire,
        Task::Inquire { choice, selected: false } => {
            Job { inquire: true, ..Job::new(choice.selection()) }
        }
        Task::Select { vendor, product, revision, serial } => {
            let (vendor, product, revision, serial) = (*vendor, *product, *revision, *serial);
            let address = Address { vendor, product, revision, serial };
            Job { release: false, ..Job::new(Selection::Address(address)) }
        }
        Task::Deselect => Job::new(Selection::Selected),
        Task::SetNodeId { node } => Job { node: Some(resolved(node, bus)?), ..inquire },
        Task::SetBitTiming { rate } => Job { bit_rate: Some(*rate), ..inquire },
        Task::Activate { delay } => Job { activate: Some(*delay), ..selected },
        Task::Store => Job { store: true, ..inquire },
        Task::Fastscan { .. } => Job { inquire: true, ..Job::new(Selection::Fastscan) },
        Task::Configure { choice, yes, node_id, bit_timing, store } => {
            choice.ensure_single(*yes)?;
            Job {
                inquire: true,
                node: node_id.as_ref().map(|node| resolved(node, bus)).transpose()?,
                bit_rate: *bit_timing,
                store: *store,
                ..Job::new(choice.selection())
            }
        }
    }))
}

/// Returns the new node-id; `None` to remove it.
fn resolved(node: &Node, bus: &SelectedBus) -> Result<Option<NodeId>, Failure> {
    node.as_ref().map(|node| bus.node(node)).transpose()
}

fn usage(message: &str) -> Failure {
    Failure::new(Kind::Usage, message)
}
