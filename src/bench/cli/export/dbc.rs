//! `frhc export dbc`: the PDO layout of a configuration and the recorder's own frames as a DBC file.

use std::path::PathBuf;

use clap::Args;

use canopen::frame::Channel;
use canopen_tools::dbc::messages::{self, Master};
use canopen_tools::dbc::{Field, Format, Message, Number};
use canopen_tools::members;
use canopen_tools::signals::identifier;
use config::Config;
use node::record::Mode;
use run::config_arg::ConfigArg;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Force};
use telemetry::session::{NODE, WRENCH};

/// `frhc export dbc`.
#[derive(Debug, Args)]
pub struct Dbc {
    #[command(flatten)]
    config: ConfigArg,
    /// Export only the bus of this name [default: all].
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    /// Write to this file instead of stdout.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

/// Writes the file.
pub(super) fn run(args: &Dbc) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    let channel = args.bus.as_ref().map(|name| channel(&config, name)).transpose()?;
    let mut members = members::members(&config);
    members.retain(|member| channel.is_none_or(|channel| member.channel == channel));
    let master = Master {
        node: config.node_id.raw(),
        period_us: u32::try_from(config.period.as_micros()).or_fail(Kind::Configuration)?,
        heartbeat_ms: u32::try_from(config.heartbeat.as_millis()).or_fail(Kind::Configuration)?,
    };
    let mut database = messages::database(&members, &master).map_err(|collision| {
        Failure::new(Kind::Usage, format!("{collision}; export one bus with --bus NAME"))
    })?;
    let joints = config.joints.iter().map(|joint| identifier(&joint.name));
    database.messages.extend([wrench(), cycle(joints)]);
    let text = database.to_string();
    match &args.out {
        None => print::line(text.trim_end()),
        Some(file) => results::export(file, text.as_bytes(), args.force)?,
    }
    Ok(())
}

fn channel(config: &Config, name: &str) -> Result<Channel, Failure> {
    let mut buses = config.channels().into_iter().zip(&config.buses);
    let found = buses.find(|(_, bus)| bus.name == name).map(|(channel, _)| channel);
    found.ok_or_else(|| {
        let names: Vec<_> = config.buses.iter().map(|bus| bus.name.as_str()).collect();
        Failure::new(
            Kind::Usage,
            format!("--bus {name}: unknown bus; expected {}", names.join(", ")),
        )
    })
}

/// Returns the recorder's message with the wrench.
fn wrench() -> Message {
    let axes = [
        ("force_x", "N"),
        ("force_y", "N"),
        ("force_z", "N"),
        ("moment_x", "N·m"),
        ("moment_y", "N·m"),
        ("moment_z", "N·m"),
    ];
    let field = |(start, (name, unit)): (u16, (&str, &'static str))| Field {
        name: name.to_owned(),
        start: start * 64,
        bits: 64,
        number: Number::Double,
        unit,
        ..Field::default()
    };
    let (_, id) = WRENCH;
    Message {
        id,
        format: Format::ExtendedFd,
        name: "Wrench".to_owned(),
        bytes: 48,
        sender: "master".to_owned(),
        comment: "session recorder: the wrench on the object at {S} used in a cycle".to_owned(),
        cycle_ms: None,
        fields: (0..).zip(axes).map(field).collect(),
    }
}

/// Returns the recorder's message at the end of a cycle.
fn cycle(joints: impl Iterator<Item = String>) -> Message {
    let plain = |name: &str, start: u16, bits: u16| Field {
        name: name.to_owned(),
        start,
        bits,
        ..Field::default()
    };
    let modes = (0..).zip(Mode::ALL.map(Mode::name)).collect();
    let mut fields = vec![
        Field { values: modes, ..plain("mode", 0, 8) },
        plain("deadman_a", 8, 1),
        plain("deadman_b", 9, 1),
        plain("reference", 10, 1),
        plain("reflection", 11, 1),
        Field {
            comment: "no frame of the switch box was received; its bits are invalid".to_owned(),
            ..plain("switch_box_silent", 15, 1)
        },
    ];
    fields
        .extend((16..).zip(joints).map(|(bit, joint)| plain(&format!("{joint}_sampled"), bit, 1)));
    fields.push(plain("cycle", 32, 32));
    let (_, id) = NODE;
    Message {
        id,
        format: Format::ExtendedFd,
        name: "Cycle".to_owned(),
        bytes: 8,
        sender: "master".to_owned(),
        comment: "session recorder: the end of a cycle".to_owned(),
        cycle_ms: None,
        fields,
    }
}
