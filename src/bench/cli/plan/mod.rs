//! `frhc plan`: bus load and timing of a configuration, computed offline.
//!
//! The plan is printed even if it does not fit; the command then fails as `run` would.

mod json;
mod text;

use clap::{Args, ValueEnum};

use canopen::load::alternatives::{self, Change, Obstacle};
use canopen::load::lacks;
use canopen::load::network::{Assumptions, Network};
use canopen::load::proposals::{self, Proposal};
use canopen::load::streams::{Role, Stream};
use canopen::load::timeline::Pauses;
use canopen_tools::bus_figures::{self, BusPlan, PlannedFrame, values};
use config::Config;
use run::config_arg::ConfigArg;
use run::exit::{Failure, Kind, OrFail};
use run::{print, stopping};

/// `frhc plan`.
#[derive(Debug, Args)]
pub struct Plan {
    #[command(flatten)]
    config: ConfigArg,
    /// Assume this SYNC rate instead of the configured one.
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Assume this PDO layout instead of the configured one.
    #[arg(long)]
    layout: Option<Layout>,
    /// Assume this bit rate, in bit/s, instead of the configured one.
    #[arg(long, value_name = "BPS", value_parser = clap::value_parser!(u32).range(10_000..=1_000_000))]
    bitrate: Option<u32>,
    /// Time from SYNC until a drive queues its TPDO, in µs.
    #[arg(long, value_name = "US", default_value_t = Assumptions::default().pauses.drive_us)]
    drive_us: u32,
    /// Time from the last TPDO to the first RPDO, in µs: the host wakes up, computes and sends.
    #[arg(long, value_name = "US", default_value_t = Assumptions::default().pauses.host_us)]
    host_us: u32,
    /// Minimum time between two bus errors, in ms [default: no errors].
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..=4_000_000))]
    error_every_ms: Option<u32>,
    /// Print the plan as one JSON object.
    #[arg(long)]
    json: bool,
}

/// PDO layouts, by their names in the configuration.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Layout {
    /// One RPDO and one TPDO per drive at every SYNC.
    PerDrive,
    /// Three target torques in one RPDO; statuswords on change.
    Grouped,
}

/// Plan of the buses, with proposals to improve it.
struct Report<'r> {
    network: &'r Network,
    assumed: Assumptions,
    buses: Vec<BusPlan>,
    proposals: Vec<Proposal>,
    obstacles: Vec<Obstacle>,
    names: Names,
}

/// Frames that several drives receive, by bus and COB-ID, in the order in which `decode` and DBC number them.
struct Names(Vec<(String, u16)>);

impl Names {
    fn from_plans(buses: &[BusPlan]) -> Self {
        let shared = |frame: &&PlannedFrame| {
            matches!(frame.stream.role, Role::Rpdo(_)) && frame.stream.nodes.len() > 1
        };
        let of_bus = |bus: &BusPlan| {
            let shared = bus.frames.iter().filter(shared).map(|frame| frame.stream.cob_id);
            let mut shared: Vec<_> = shared.map(|cob_id| (bus.name.clone(), cob_id)).collect();
            shared.sort();
            shared
        };
        Self(buses.iter().flat_map(of_bus).collect())
    }

    /// Returns the name of a frame without the node, such as `TPDO1` or `RPDO1_group1`.
    fn frame(&self, bus: &BusPlan, stream: &Stream) -> String {
        let role = text::role(stream.role);
        let is_it = |(name, cob_id): &(String, u16)| *name == bus.name && *cob_id == stream.cob_id;
        let group = self.0.iter().position(is_it);
        group.map_or_else(|| role.clone(), |place| format!("{role}_group{}", place + 1))
    }
}

/// Prints the plan; fails if it cannot run.
pub(super) fn run(args: &Plan) -> Result<(), Failure> {
    let file = &args.config.config;
    let config = Config::load_to_plan(file).or_fail(Kind::Configuration)?;
    let network = with_flags(config.network(), args)?;
    let assumed = Assumptions {
        pauses: Pauses { drive_us: args.drive_us, host_us: args.host_us },
        error_gap_us: args.error_every_ms.map(|ms| ms.saturating_mul(1_000)),
        ..Assumptions::default()
    };
    let buses = bus_figures::plans(&network, &values::typical_values(&config), &assumed);
    let report = Report {
        names: Names::from_plans(&buses),
        buses,
        proposals: proposals::proposals(&network, &assumed),
        obstacles: alternatives::obstacles(&network),
        network: &network,
        assumed,
    };
    if args.json {
        print::line(&json::object(&report, &config));
    } else {
        stopping::lines(&config).iter().for_each(|line| print::line(line));
        print::line(&text::report(&report));
    }
    if network == config.network() {
        Config::load(file).map(|_| ()).or_fail(Kind::Configuration)
    } else {
        check_load(&report)
    }
}

/// Returns `network` changed by the flags.
fn with_flags(mut network: Network, args: &Plan) -> Result<Network, Failure> {
    for bus in &mut network.buses {
        bus.bitrate = args.bitrate.unwrap_or(bus.bitrate);
    }
    let layout = args.layout.map(|layout| match layout {
        Layout::PerDrive => Change::PerDrive,
        Layout::Grouped => Change::Grouped,
    });
    let cannot: Vec<String> = alternatives::obstacles(&network).iter().map(obstacle).collect();
    if matches!(layout, Some(Change::Grouped)) && !cannot.is_empty() {
        return Err(Failure::new(Kind::Configuration, cannot.join("\n")));
    }
    let period = args.rate.map(|hz| Change::Period(period_us(hz)));
    // `changed` returns None for a change that is already in effect.
    let changes = layout.into_iter().chain(period);
    Ok(changes.fold(network, |network, change| {
        alternatives::changed(&network, &[change]).unwrap_or(network)
    }))
}

/// Returns a failure for the buses above their load limit.
fn check_load(report: &Report<'_>) -> Result<(), Failure> {
    let overloads = report.buses.iter().filter_map(|bus| {
        let overload = bus.utilisation.worst.within(bus.load_limit_percent).err()?;
        Some(format!("bus {}: {overload}", bus.name))
    });
    let overloads: Vec<String> = overloads.collect();
    if overloads.is_empty() {
        return Ok(());
    }
    Err(Failure::new(Kind::Configuration, overloads.join("\n")))
}

fn obstacle(obstacle: &Obstacle) -> String {
    format!("{}: torques cannot be grouped: {}", obstacle.drive, reason(obstacle))
}

fn reason(obstacle: &Obstacle) -> String {
    format!("its EDS lacks {}", lacks::listed(&obstacle.lacks))
}

/// Parses a SYNC rate in Hz.
fn rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| "must be a number".to_owned())?;
    if (1.0..=10_000.0).contains(&rate) { Ok(rate) } else { Err("must be within 1..=10000".into()) }
}

/// Converts a rate within 1 and 10000 Hz to a period in µs, rounded.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within 100 and 1e6"
)]
fn period_us(hz: f64) -> u32 {
    (1e6 / hz).round() as u32
}
