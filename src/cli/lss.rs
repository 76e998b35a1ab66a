//! `frhc lss`: node-ids and bit rates of devices, over the bus (CiA 305).

use std::time::Duration;

use clap::Args;
use clap::Subcommand;

use crate::cli::bench::Beside;
use crate::cli::bench::Line;
use crate::cli::bench::Session;
use crate::cli::bench::SessionError;
use crate::cli::bench::words;
use bus::Bus;
use canopen::NodeId;
use canopen::lss::Address;
use canopen::lss::BitRate;
use canopen::lss::identify::Description;
use canopen::lss::identify::Identify;
use canopen::lss::job::Job;
use canopen::lss::job::Report;
use canopen::lss::job::Selection;
use canopen::lss::job::Timeouts;
use canopen::lss::master::Master;
use canopen_tools::diagnostics::scan::Found;
use canopen_tools::diagnostics::scan::Scan;
use run::exit::Failure;
use run::exit::Kind;
use run::exit::OrFail;
use run::print;

/// `frhc lss`.
#[derive(Debug, Args)]
#[command(
    after_help = "`configure` does everything in one call and leaves every slave waiting, whatever happens. The \
        others are single services: between them the slave stays selected, until `deselect` or a failure.\n\n\
        What selects or sets is refused while SYNCs are received, unless forced. `deselect`, `identify-remote` and \
        `identify-non-configured` change nothing.\n\n\
        A new node-id is a configured slave's own after `frhc nmt reset-comm`, and an unconfigured one's at once.\n\n\
        Examples:\n  frhc lss fastscan -i can0\n  \
        frhc lss configure --select 0xF8C,0x04020010,0x00010000,3 --node-id 3 --store -i can0\n  \
        frhc lss configure --fastscan --node-id 4 --bit-timing 1000 --store -i can0"
)]
pub(crate) struct Lss {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    line: Line,
    /// How long slaves have for an answer; a second at least for storing.
    #[arg(long, value_name = "MS", default_value_t = 100, global = true,
        value_parser = clap::value_parser!(u64).range(1..=600_000))]
    timeout: u64,
    #[command(flatten)]
    force: Beside,
    /// What is found as one JSON object.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Identity and node-id of the one slave on the bus, or of one that is chosen; then all wait.
    #[command(after_help = "Example:\n  frhc lss inquire -i can0")]
    Inquire {
        #[command(flatten)]
        choice: Choice,
        /// The slave that is selected already; it stays so.
        #[arg(long, conflicts_with_all = ["select", "fastscan", "global", "probe"])]
        selected: bool,
    },
    /// Selects the slave of an identity; it stays selected.
    #[command(after_help = "Example:\n  frhc lss select 0xF8C 0x04020010 0x00010000 3 -i can0")]
    Select {
        /// Vendor-ID, 1018h:1.
        #[arg(value_parser = words::number)]
        vendor: u32,
        /// Product code, 1018h:2.
        #[arg(value_parser = words::number)]
        product: u32,
        /// Revision number, 1018h:3.
        #[arg(value_parser = words::number)]
        revision: u32,
        /// Serial number, 1018h:4.
        #[arg(value_parser = words::number)]
        serial: u32,
    },
    /// All slaves wait: none is selected any more.
    #[command(after_help = "Example:\n  frhc lss deselect -i can0")]
    Deselect,
    /// The node-id of the selected slave, from its next reset of communication on.
    #[command(after_help = "Example:\n  frhc lss set-node-id 4 -i can0")]
    SetNodeId {
        /// 1 to 127; none, or 255, takes it away.
        #[arg(value_parser = words::node_or_none)]
        node: Node,
    },
    /// The bit rate of the selected slave, from its activation on.
    #[command(after_help = "Example:\n  frhc lss set-bit-timing 500 -i can0")]
    SetBitTiming {
        /// In kbit/s: 1000, 800, 500, 250, 125, 50, 20, 10.
        #[arg(value_name = "KBIT", value_parser = bit_rate)]
        rate: BitRate,
    },
    /// The selected slaves change their bit rates; this interface does not.
    #[command(after_help = "Example:\n  frhc lss activate 1000 -i can0")]
    Activate {
        /// They stop sending, change after this, and go on after this again.
        #[arg(value_name = "DELAY_MS")]
        delay: u16,
    },
    /// The selected slave keeps node-id and bit rate without power.
    #[command(after_help = "Example:\n  frhc lss store -i can0")]
    Store,
    /// Finds the identity of one slave without a node-id; then all wait.
    #[command(after_help = "Example:\n  frhc lss fastscan --probe 5 -i can0")]
    Fastscan {
        #[command(flatten)]
        probe: Probe,
    },
    /// Whether any slave fits a description.
    #[command(
        after_help = "Example:\n  frhc lss identify-remote 0xF8C 0x04020010 0 0xFFFFFFFF 0 0xFFFFFFFF -i can0"
    )]
    IdentifyRemote {
        /// Vendor-ID, product code, lowest and highest revision number, lowest and highest serial number.
        #[arg(value_names = ["VENDOR", "PRODUCT", "REVISION", "REVISION", "SERIAL", "SERIAL"], num_args = 6,
            value_parser = words::number)]
        numbers: Vec<u32>,
    },
    /// Whether any slave is without a node-id.
    #[command(after_help = "Example:\n  frhc lss identify-non-configured -i can0")]
    IdentifyNonConfigured,
    /// Chooses a slave, sets and stores, and lets all wait.
    #[command(after_help = "Example:\n  frhc lss configure --fastscan --node-id 4 --store -i can0")]
    Configure {
        #[command(flatten)]
        choice: Choice,
        /// With --global: only one slave is on the bus. Answers of several can look like those of one.
        #[arg(long)]
        yes: bool,
        /// Its node-id from now on, 1 to 127; none, or 255, takes it away.
        #[arg(long, value_name = "N", value_parser = words::node_or_none, required_unless_present = "bit_timing")]
        node_id: Option<Node>,
        /// Its bit rate, in kbit/s.
        #[arg(long, value_name = "KBIT", value_parser = bit_rate)]
        bit_timing: Option<BitRate>,
        /// Both outlast a loss of power.
        #[arg(long)]
        store: bool,
    },
}

/// A node-id, or none: as words say it, and not as an argument that may be left out.
type Node = Option<NodeId>;

/// Which slave.
#[derive(Debug, Args)]
struct Choice {
    /// The slave of this identity.
    #[arg(long, value_name = "VENDOR,PRODUCT,REVISION,SERIAL", value_parser = address, group = "choice")]
    select: Option<Address>,
    /// The slave without a node-id that a fastscan finds.
    #[arg(long, group = "choice")]
    fastscan: bool,
    /// With --fastscan: how long slaves have for each of its 133 questions.
    #[arg(long, value_name = "MS", default_value_t = 20, requires = "fastscan",
        conflicts_with_all = ["select", "global"],
        value_parser = clap::value_parser!(u64).range(1..=10_000))]
    probe: u64,
    /// Every slave: right where there is one only.
    #[arg(long, group = "choice")]
    global: bool,
}

/// The pace of a fastscan.
#[derive(Clone, Copy, Debug, Args)]
struct Probe {
    /// How long slaves have for each of the 133 questions.
    #[arg(long, value_name = "MS", default_value_t = 20,
        value_parser = clap::value_parser!(u64).range(1..=10_000))]
    probe: u64,
}

impl Task {
    /// How long slaves have for each question of a fastscan; for nothing where there is none.
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
    /// What was chosen; without a word, every slave.
    fn selection(&self) -> Selection {
        match (self.select, self.fastscan) {
            (Some(address), _) => Selection::Address(address),
            (None, true) => Selection::Fastscan,
            (None, false) => Selection::All,
        }
    }

    /// Whoever configures says whom, and that it is one slave only.
    fn must_be_one(&self, is_sure: bool) -> Result<(), Failure> {
        if !self.global && !self.fastscan && self.select.is_none() {
            Err(usage("which slave? Say --select, --fastscan or --global"))
        } else if self.global && !is_sure {
            Err(usage("--global configures every slave on the bus; say --yes if there is only one"))
        } else {
            Ok(())
        }
    }
}

/// `VENDOR,PRODUCT,REVISION,SERIAL`.
fn address(text: &str) -> Result<Address, String> {
    let numbers: Vec<u32> = text.split(',').map(words::number).collect::<Result<_, _>>()?;
    let &[vendor, product, revision, serial] = numbers.as_slice() else {
        return Err("not four numbers: VENDOR,PRODUCT,REVISION,SERIAL".to_owned());
    };
    Ok(Address { vendor, product, revision, serial })
}

fn bit_rate(text: &str) -> Result<BitRate, String> {
    let rate = text.parse().ok().and_then(BitRate::of_kilobits);
    rate.ok_or_else(|| "none of 1000, 800, 500, 250, 125, 50, 20, 10 kbit/s".to_owned())
}

/// What a task comes to.
enum Plan {
    /// Something is done with one slave.
    Do(Job),
    /// Slaves of a description are looked for, or without one, those that have no node-id.
    Find(Option<Description>),
}

/// Does one task.
pub(super) fn run(args: &Lss) -> Result<(), Failure> {
    match plan(&args.task)? {
        Plan::Find(description) => find(args, description),
        Plan::Do(job) => carry_out(args, job),
    }
}

/// What is to be done. More than one slave must not get the same node-id unseen.
fn plan(task: &Task) -> Result<Plan, Failure> {
    let selected = Job { release: false, ..Job::new(Selection::Selected) };
    let asked = Job { inquire: true, ..selected };
    Ok(Plan::Do(match task {
        Task::IdentifyNonConfigured => return Ok(Plan::Find(None)),
        Task::IdentifyRemote { numbers } => {
            let &[vendor, product, r0, r1, s0, s1] = numbers.as_slice() else {
                return Err(usage("say VENDOR PRODUCT REVISION REVISION SERIAL SERIAL"));
            };
            let (revision, serial) = ([r0, r1], [s0, s1]);
            return Ok(Plan::Find(Some(Description { vendor, product, revision, serial })));
        }
        Task::Inquire { selected: true, .. } => asked,
        Task::Inquire { choice, selected: false } => {
            Job { inquire: true, ..Job::new(choice.selection()) }
        }
        Task::Select { vendor, product, revision, serial } => {
            let (vendor, product, revision, serial) = (*vendor, *product, *revision, *serial);
            let address = Address { vendor, product, revision, serial };
            Job { release: false, ..Job::new(Selection::Address(address)) }
        }
        Task::Deselect => Job::new(Selection::Selected),
        Task::SetNodeId { node } => Job { node: Some(*node), ..asked },
        Task::SetBitTiming { rate } => Job { bit_rate: Some(*rate), ..asked },
        Task::Activate { delay } => Job { activate: Some(*delay), ..selected },
        Task::Store => Job { store: true, ..asked },
        Task::Fastscan { .. } => Job { inquire: true, ..Job::new(Selection::Fastscan) },
        Task::Configure { choice, yes, node_id, bit_timing, store } => {
            choice.must_be_one(*yes)?;
            Job {
                inquire: true,
                node: *node_id,
                bit_rate: *bit_timing,
                store: *store,
                ..Job::new(choice.selection())
            }
        }
    }))
}

/// Carries a job out, and tells what has come of it.
fn carry_out(args: &Lss, job: Job) -> Result<(), Failure> {
    let reply = Duration::from_millis(args.timeout);
    let timeouts =
        Timeouts { reply, store: reply.max(Duration::from_secs(1)), probe: args.task.probe() };
    let known = args.line.find()?;
    let leaves_all_alone = matches!(args.task, Task::Deselect);
    let force = Beside { force: args.force.force || leaves_all_alone };
    let mut session = known.open_to_command(force)?;
    if let Some(Some(node)) = job.node {
        let owner = owner(&mut session, node, reply).map_err(|error| known.fail(error))?;
        must_be_free(node, owner.as_ref(), job.selection)?;
    }
    let outcome = session.run(|now, out| Master::start(job, timeouts, now, out));
    let report = outcome.map_err(|error| known.fail(error))?.or_fail(Kind::Drive)?;
    show(args.json, &report);
    tell(&job, &report);
    Ok(())
}

/// Who has a node-id now.
fn owner<B: Bus>(
    session: &mut Session<B>,
    node: NodeId,
    timeout: Duration,
) -> Result<Option<Found>, SessionError> {
    let found = session.run(|now, out| Scan::start(&[node], timeout, Duration::ZERO, now, out))?;
    Ok(found.into_iter().find(|found| found.node == node))
}

/// Two slaves of one node-id would speak at once. Whether it is the slave's own already is known where it
/// was chosen by its identity, or has none.
fn must_be_free(node: NodeId, owner: Option<&Found>, selection: Selection) -> Result<(), Failure> {
    let is_its_own = |owner: &Found| match selection {
        Selection::Address(address) => owner.address() == Some(address),
        Selection::Fastscan => false,
        Selection::Selected | Selection::All => true,
    };
    match owner.filter(|owner| !is_its_own(owner)) {
        None => Ok(()),
        Some(owner) => {
            let who = owner.address().map(|address| format!(" by {address}")).unwrap_or_default();
            Err(Failure::new(Kind::Drive, format!("node-id {} is taken{who}", node.raw())))
        }
    }
}

fn usage(message: &str) -> Failure {
    Failure::new(Kind::Usage, message)
}

/// Looks for slaves of a description, or without a node-id.
fn find(args: &Lss, description: Option<Description>) -> Result<(), Failure> {
    let window = Duration::from_millis(args.timeout);
    let known = args.line.find()?;
    let answers = known
        .open()?
        .run(|now, out| match description {
            Some(description) => Identify::remote(description, window, now, out),
            None => Identify::non_configured(window, now, out),
        })
        .map_err(|error| known.fail(error))?;
    if args.json {
        print::line(&serde_json::json!({ "found": answers > 0, "answers": answers }).to_string());
    }
    let whom = if description.is_some() { "of this description" } else { "without a node-id" };
    if answers == 0 {
        return Err(Failure::new(Kind::Drive, format!("no slave {whom} answers")));
    }
    if !args.json {
        print::line(&format!("at least one slave {whom}"));
    }
    Ok(())
}

/// Identity and node-id, as far as they were asked.
fn show(json: bool, report: &Report) {
    let Report { address, node, is_booted } = *report;
    if json {
        let of_address = address.map(|Address { vendor, product, revision, serial }| {
            serde_json::json!({
                "vendor": vendor, "product": product, "revision": revision, "serial": serial,
            })
        });
        let node = node.map(|node| node.map_or(255, NodeId::raw));
        let report =
            serde_json::json!({ "address": of_address, "node": node, "booted": is_booted });
        print::line(&report.to_string());
        return;
    }
    if let Some(Address { vendor, product, revision, serial }) = address {
        let mut line = format!(
            "vendor 0x{vendor:08X}, product 0x{product:08X}, revision 0x{revision:08X}, serial 0x{serial:08X}"
        );
        if let Some(node) = node {
            let node = node.map_or("no node-id".to_owned(), |node| format!("node {}", node.raw()));
            line.push_str(&format!(", {node}"));
        }
        print::line(&line);
    }
}

/// What the user should know of what comes next.
fn tell(job: &Job, report: &Report) {
    let booted = report.is_booted;
    match (job.node, report.node) {
        (Some(Some(new)), Some(None)) if booted => {
            print::note(&format!("node {} has booted up", new.raw()));
        }
        (Some(Some(new)), Some(None)) if job.release => {
            print::note(&format!("node {} was not heard to boot up", new.raw()));
        }
        (Some(Some(_)), Some(None)) => print::note("in effect after: frhc lss deselect"),
        (Some(_), Some(Some(old))) => {
            print::note(&format!("in effect after: frhc nmt reset-comm {}", old.raw()));
        }
        (Some(_), None) => print::note("in effect after a reset of communication"),
        (None, _) | (Some(None), Some(None)) => {}
    }
    if job.node.is_some() && !job.store {
        print::note("not stored: it is lost with power");
    }
    if job.activate.is_some() {
        print::note("the bit rate of this interface is yours to change, before they speak again");
    }
    if !job.release {
        print::note("the slave stays selected, until: frhc lss deselect");
    }
}
