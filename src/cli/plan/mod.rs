//! `frhc plan`: what a network will carry, before a frame is sent. Touches no bus.
//!
//! The plan is printed whether it fits or not; what `run` would refuse, this refuses behind it.

mod json;
mod text;

use clap::Args;
use clap::ValueEnum;

use canopen::load::alternatives;
use canopen::load::alternatives::Change;
use canopen::load::alternatives::Obstacle;
use canopen::load::network::Assumptions;
use canopen::load::network::BusPlan;
use canopen::load::network::Network;
use canopen::load::proposals;
use canopen::load::proposals::Proposal;
use canopen::load::timeline::Pauses;
use config::Config;
use run::configured::Configured;
use run::exit::Failure;
use run::exit::Kind;
use run::exit::OrFail;
use run::print;

/// `frhc plan`.
#[derive(Debug, Args)]
pub(crate) struct Plan {
    #[command(flatten)]
    config: Configured,
    /// As if SYNC came so often.
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// As if the buses had this layout.
    #[arg(long)]
    layout: Option<Layout>,
    /// As if the buses had this bit rate, in bit/s.
    #[arg(long, value_name = "BPS", value_parser = clap::value_parser!(u32).range(10_000..=1_000_000))]
    bitrate: Option<u32>,
    /// From SYNC until a drive queues its TPDO, in µs.
    #[arg(long, value_name = "US", default_value_t = Assumptions::default().pauses.drive_us)]
    drive_us: u32,
    /// From the last TPDO to the first RPDO, in µs: the host wakes, computes and sends.
    #[arg(long, value_name = "US", default_value_t = Assumptions::default().pauses.host_us)]
    host_us: u32,
    /// The least time between two errors on the wire, in ms; none if not given.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..=4_000_000))]
    error_every_ms: Option<u32>,
    /// Everything as one JSON object.
    #[arg(long)]
    json: bool,
}

/// A layout by its name in the configuration.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Layout {
    /// One RPDO and one TPDO a drive, at every SYNC.
    PerDrive,
    /// Three torques in one RPDO; states on change.
    Grouped,
}

/// A plan and what could be done about it.
struct Report<'r> {
    network: &'r Network,
    assumed: Assumptions,
    buses: Vec<BusPlan>,
    proposals: Vec<Proposal>,
    obstacles: Vec<Obstacle>,
}

/// Plans, prints, and refuses what cannot run.
pub(super) fn run(args: &Plan) -> Result<(), Failure> {
    let file = &args.config.config;
    let config = Config::load_to_plan(file).or_fail(Kind::Configuration)?;
    let network = as_asked(config.network(), args)?;
    let assumed = Assumptions {
        pauses: Pauses { drive_us: args.drive_us, host_us: args.host_us },
        error_gap_us: args.error_every_ms.map(|ms| ms.saturating_mul(1_000)),
        ..Assumptions::default()
    };
    let report = Report {
        buses: network.plan(&assumed),
        proposals: proposals::proposals(&network, &assumed),
        obstacles: alternatives::obstacles(&network),
        network: &network,
        assumed,
    };
    print::line(&if args.json { json::of(&report) } else { text::of(&report) });
    if network == config.network() {
        Config::load(file).map(|_| ()).or_fail(Kind::Configuration)
    } else {
        refuse(&report)
    }
}

/// `network` with what the flags say otherwise.
fn as_asked(mut network: Network, args: &Plan) -> Result<Network, Failure> {
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
    // What changes nothing was so already.
    let asked = layout.into_iter().chain(period);
    Ok(asked.fold(network, |network, change| {
        alternatives::changed(&network, &[change]).unwrap_or(network)
    }))
}

/// Refuses the buses that carry too much.
fn refuse(report: &Report<'_>) -> Result<(), Failure> {
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
    format!("{}: torques cannot be grouped: {}", obstacle.drive, obstacle.reason)
}

/// A rate in Hz, within what SYNC periods can be.
fn rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (1.0..=10_000.0).contains(&rate) { Ok(rate) } else { Err("not within 1 and 10000".into()) }
}

/// The period of a rate within 1 and 10000 Hz, in whole µs.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within 100 and 1e6"
)]
fn period_us(hz: f64) -> u32 {
    (1e6 / hz).round() as u32
}
