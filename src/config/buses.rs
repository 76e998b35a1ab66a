//! `[[bus]]`: the CAN buses, their interfaces and bit rates, and which PDOs their drives have.

use std::collections::HashSet;

use crate::names;
use crate::problem::Problems;
use crate::raw;

/// Bit rates of CiA 301 (4.2), in bit/s.
const BITRATES: [u32; 8] = [10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// The longest name of a network interface.
const LONGEST_INTERFACE: usize = 15;

/// One CAN bus.
#[derive(Clone, Debug)]
pub struct BusSettings {
    /// What people call it.
    pub name: String,
    /// Its SocketCAN interface.
    pub interface: String,
    /// In bit/s.
    pub bitrate: u32,
    /// Which PDOs its drives have.
    pub layout: Layout,
    /// The most its worst case may take, in percent of the bit rate.
    pub load_limit_percent: f64,
}

/// Which PDOs the drives of a bus have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// One each way for each drive.
    #[default]
    PerDrive,
    /// One frame of targets for three drives.
    Grouped,
}

impl Layout {
    fn called(name: &str) -> Option<Self> {
        match name {
            "per-drive" => Some(Self::PerDrive),
            "grouped" => Some(Self::Grouped),
            _ => None,
        }
    }
}

/// All of them, in the order of their channels.
pub(super) fn read(raw: &raw::File, problems: &mut Problems<'_>) -> Vec<BusSettings> {
    if raw.bus.is_empty() || raw.bus.len() > 8 {
        problems.add("bus", format_args!("{} buses; there must be 1 to 8", raw.bus.len()));
    }
    names::check("bus", raw.bus.iter().map(|bus| bus.name.as_str()), problems);
    let mut interfaces = HashSet::new();
    for (place, bus) in raw.bus.iter().enumerate() {
        let key = |name: &str| format!("bus[{place}].{name}");
        if !interfaces.insert(&bus.interface) {
            problems.add(
                &key("interface"),
                format_args!("\"{}\" is taken", bus.interface.escape_debug()),
            );
        }
        if !is_interface(&bus.interface) {
            let shown = bus.interface.escape_debug();
            problems.add(&key("interface"), format_args!("\"{shown}\" is no interface"));
        }
        if !BITRATES.contains(&bus.bitrate) {
            problems.add(&key("bitrate"), format_args!("{} is none of {BITRATES:?}", bus.bitrate));
        }
        if Layout::called(&bus.layout).is_none() {
            let reason = format!("\"{}\": there are \"per-drive\" and \"grouped\"", bus.layout);
            problems.add(&key("layout"), reason);
        }
        problems.within(&key("load_limit_percent"), bus.load_limit_percent, 1.0..=100.0);
    }
    raw.bus
        .iter()
        .map(|bus| BusSettings {
            name: bus.name.clone(),
            interface: bus.interface.clone(),
            bitrate: bus.bitrate,
            layout: Layout::called(&bus.layout).unwrap_or_default(),
            load_limit_percent: bus.load_limit_percent,
        })
        .collect()
}

/// Whether Linux may have an interface of that name (`dev_valid_name`).
fn is_interface(name: &str) -> bool {
    let is_odd = |c: char| c == '/' || c == ':' || c.is_whitespace() || c.is_control();
    (1..=LONGEST_INTERFACE).contains(&name.len())
        && name != "."
        && name != ".."
        && !name.contains(is_odd)
}
