//! File information, device information and commissioning.

use crate::eds::device::BITRATES;
use crate::eds::ini::Section;
use crate::eds::lint::{Lint, Spot};
use crate::eds::title::{Heading, Title};
use crate::eds::{read, value};
use crate::object::Object;

/// Keys of `[DeviceInfo]`, and the objects with the same numbers.
const IDENTITY: [(&str, Object); 3] = [
    ("VendorNumber", Object::VENDOR_ID),
    ("ProductNumber", Object::PRODUCT_CODE),
    ("RevisionNumber", Object::REVISION),
];

pub(super) fn check(lint: &mut Lint<'_>) {
    if lint.ini.section(Title::Named(Heading::FileInfo)).is_none() {
        lint.warning(Spot::missing(Title::Named(Heading::FileInfo)), "is missing");
    }
    match lint.ini.section(Title::Named(Heading::DeviceInfo)) {
        None => lint.error(Spot::missing(Title::Named(Heading::DeviceInfo)), "is missing"),
        Some(section) => info(lint, section),
    }
    if let Some(section) = lint.ini.section(Title::Named(Heading::Commissioning)) {
        commissioning(lint, section);
    }
    if let Some(section) = lint.ini.section(Title::Named(Heading::DummyUsage)) {
        flags(lint, section, "Dummy");
    }
}

fn info(lint: &mut Lint<'_>, section: &Section<'_>) {
    for (key, object) in IDENTITY {
        match (section.value(key), read::unsigned::<u32>(section, key)) {
            (None, _) => lint.warning(Spot::key(section, key), "is missing"),
            (Some(_), None) => lint.error(Spot::key(section, key), "not a 32-bit number"),
            (Some(_), Some(stated)) => identity(lint, section, key, (stated, object)),
        }
    }
    flags(lint, section, "BaudRate_");
    if lint.eds.device().bitrates.is_empty() {
        lint.warning(Spot::section(section), "names no bit rate");
    }
    for (key, first) in [
        ("NrOfRXPDO", Object::rpdo_communication(1, 0)),
        ("NrOfTXPDO", Object::tpdo_communication(1, 0)),
    ] {
        number_of_pdos(lint, section, key, first);
    }
}

/// Checks the identity numbers against the identity object alone.
pub(super) fn identity_conflicts(lint: &mut Lint<'_>) {
    let Some(section) = lint.ini.section(Title::Named(Heading::DeviceInfo)) else { return };
    for (key, object) in IDENTITY {
        if let Some(stated) = read::unsigned(section, key) {
            identity(lint, section, key, (stated, object));
        }
    }
}

/// Checks an identity number, which the identity object repeats.
fn identity<'t>(
    lint: &mut Lint<'_>,
    section: &Section<'t>,
    key: &'t str,
    (stated, object): (u32, Object),
) {
    let default = lint.eds.object(object).and_then(|described| described.number);
    let default = default.map_or(0, |number| number.value);
    if default != 0 && default != stated.into() {
        let but = format_args!(
            "{stated:08X}h, but the default of {object}, which counts, is {default:08X}h"
        );
        lint.warning(Spot::key(section, key), but);
    }
}

/// Checks flags, which must be 0 or 1.
fn flags(lint: &mut Lint<'_>, section: &Section<'_>, prefix: &str) {
    let is_flag =
        |key: &str| key.get(..prefix.len()).is_some_and(|start| start.eq_ignore_ascii_case(prefix));
    for entry in section.entries.iter().filter(|entry| is_flag(entry.key)) {
        let value = value::whole(entry.word()).map(|(value, _)| value);
        if !matches!(value, Some(0 | 1)) {
            lint.warning(Spot::entry(section, entry), "neither 0 nor 1");
        }
    }
}

/// Checks a number of PDOs against the communication parameters from `first`.
fn number_of_pdos<'t>(lint: &mut Lint<'_>, section: &Section<'t>, key: &'t str, first: Object) {
    let Some(stated) = read::integer(section, key) else { return };
    let range = first.index..first.index.saturating_add(512);
    let mut described: Vec<_> = lint.eds.objects().iter().map(|one| one.object.index).collect();
    described.retain(|index| range.contains(index));
    described.dedup();
    if i128::try_from(described.len()) != Ok(stated) {
        let but = format_args!("{stated}, but {} are described", described.len());
        lint.warning(Spot::key(section, key), but);
    }
}

/// Tools write 0 into the DCF of a device that is not commissioned yet.
const UNCOMMISSIONED: &str = "0: the device is not commissioned";

fn commissioning(lint: &mut Lint<'_>, section: &Section<'_>) {
    let commissioning = lint.eds.commissioning();
    let spot = Spot::key(section, "NodeID");
    if read::integer(section, "NodeID") == Some(0) {
        lint.warning(spot, UNCOMMISSIONED);
    } else if commissioning.is_some_and(|it| it.node.is_none()) {
        lint.error(spot, "must be within 1..=127");
    }
    let spot = Spot::key(section, "Baudrate");
    match commissioning.and_then(|it| it.bitrate) {
        None if section.value("Baudrate").is_none() => {}
        Some(0) => lint.warning(spot, UNCOMMISSIONED),
        Some(rate) if BITRATES.contains(&rate) => {}
        Some(_) | None => {
            lint.error(spot, format_args!("must be one of {BITRATES:?}, in kbit/s"));
        }
    }
}
