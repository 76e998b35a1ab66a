//! `[[bus]]`: CAN buses with interface, bit rate and PDO layout.

use std::collections::HashSet;

use crate::problem::Problems;
use crate::value::Value;
use crate::{names, raw};

/// Bit rates of CiA 301 (4.2), in bit/s.
const BITRATES: [u32; 8] = [10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// Maximum length of an interface name (Linux `IFNAMSIZ` - 1).
const MAX_INTERFACE_LENGTH: usize = 15;

/// One CAN bus.
#[derive(Clone, Debug)]
pub struct BusSettings {
    /// Name in messages, and in the `bus` keys of nodes.
    pub name: String,
    /// SocketCAN interface, such as `can0`.
    pub interface: String,
    /// Bit rate, in bit/s.
    pub bitrate: u32,
    /// PDO layout of the drives on the bus.
    pub layout: Layout,
    /// Maximum worst-case load, in percent of the bit rate.
    pub load_limit_percent: f64,
}

/// PDO layout of the drives of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// One RPDO and one TPDO per drive.
    #[default]
    PerDrive,
    /// One frame of target torques for three drives.
    Grouped,
}

impl Layout {
    /// Every layout, the default first.
    pub(super) const ALL: [Self; 2] = [Self::PerDrive, Self::Grouped];

    /// Name in the configuration.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PerDrive => "per-drive",
            Self::Grouped => "grouped",
        }
    }

    fn called(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|layout| layout.name() == name)
    }
}

/// Reads all buses, in the order of their channels. Returns `None` after a problem.
pub(super) fn read(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Vec<BusSettings>> {
    let given = raw.bus.all();
    if !raw.bus.is_noted() && !(1..=8).contains(&given.len()) {
        problems.add(&raw.bus, format_args!("{} buses; there must be 1 to 8", given.len()));
    }
    names::check(given.iter().map(|bus| &bus.name), problems);
    let mut taken = HashSet::new();
    let buses: Vec<_> = given.iter().map(|bus| one(bus, &mut taken, problems)).collect();
    if raw.bus.is_noted() { None } else { buses.into_iter().collect() }
}

/// Reads one bus, and adds its interface to `taken`, which must not contain it.
fn one<'r>(
    bus: &'r raw::Bus,
    taken: &mut HashSet<&'r str>,
    problems: &mut Problems<'_>,
) -> Option<BusSettings> {
    let interface = interface(&bus.interface, taken, problems);
    let bitrate = bus.bitrate.get();
    if let Some(unusual) = bitrate.filter(|bitrate| !BITRATES.contains(bitrate)) {
        problems.add(&bus.bitrate, format_args!("must be one of {BITRATES:?}, got {unusual}"));
    }
    let layout = bus.layout.as_ref().map(|called| {
        Layout::called(called).unwrap_or_else(|| {
            let reason =
                format!("unknown value \"{called}\"; expected \"per-drive\" or \"grouped\"");
            problems.add(&bus.layout, reason);
            Layout::default()
        })
    });
    let load_limit_percent = problems.within(&bus.load_limit_percent, 1.0..=100.0);
    Some(BusSettings {
        name: bus.name.as_ref()?.clone(),
        interface: interface?.to_owned(),
        bitrate: bitrate?,
        layout: layout?,
        load_limit_percent: load_limit_percent?,
    })
}

fn interface<'r>(
    value: &'r Value<String>,
    taken: &mut HashSet<&'r str>,
    problems: &mut Problems<'_>,
) -> Option<&'r str> {
    let name = value.as_ref()?.as_str();
    let shown = name.escape_debug();
    if !taken.insert(name) {
        problems.add(value, format_args!("must be unique, got \"{shown}\" twice"));
    }
    if !is_interface(name) {
        problems.add(value, format_args!("must be a name of a Linux interface, got \"{shown}\""));
    }
    Some(name)
}

/// Returns whether Linux may have an interface of that name (`dev_valid_name`).
fn is_interface(name: &str) -> bool {
    let is_odd = |c: char| c == '/' || c == ':' || c.is_whitespace() || c.is_control();
    (1..=MAX_INTERFACE_LENGTH).contains(&name.len())
        && name != "."
        && name != ".."
        && !name.contains(is_odd)
}
