//! What a file says of itself, of the device as a whole, and of where it is.

use crate::canopen::eds::device::BITRATES;
use crate::canopen::eds::ini::Section;
use crate::canopen::eds::lint::Lint;
use crate::canopen::eds::lint::line_of;
use crate::canopen::eds::read;
use crate::canopen::eds::title::Named;
use crate::canopen::eds::title::Title;
use crate::canopen::eds::value;
use crate::canopen::object::Object;

pub(super) fn check(lint: &mut Lint<'_>) {
    if lint.ini.section(Title::Named(Named::FileInfo)).is_none() {
        lint.warning(1, Some(Title::Named(Named::FileInfo)), "", "is missing");
    }
    match lint.ini.section(Title::Named(Named::DeviceInfo)) {
        None => lint.error(1, Some(Title::Named(Named::DeviceInfo)), "", "is missing"),
        Some(section) => info(lint, section),
    }
    if let Some(section) = lint.ini.section(Title::Named(Named::Commissioning)) {
        commissioning(lint, section);
    }
    if let Some(section) = lint.ini.section(Title::Named(Named::DummyUsage)) {
        flags(lint, section, |key| key.to_ascii_lowercase().starts_with("dummy"));
    }
}

fn info(lint: &mut Lint<'_>, section: &Section<'_>) {
    for (key, object) in [
        ("VendorNumber", Object::VENDOR_ID),
        ("ProductNumber", Object::PRODUCT_CODE),
        ("RevisionNumber", Object::REVISION),
    ] {
        identity(lint, section, key, object);
    }
    flags(lint, section, |key| key.to_ascii_lowercase().starts_with("baudrate_"));
    if lint.eds.device().bitrates.is_empty() {
        lint.warning(section.line, Some(section.title), "", "names no bit rate");
    }
    for (key, first) in [
        ("NrOfRXPDO", Object::rpdo_communication(1, 0)),
        ("NrOfTXPDO", Object::tpdo_communication(1, 0)),
    ] {
        number_of_pdos(lint, section, key, first.index);
    }
}

/// A number of the identity, which the identity object repeats.
fn identity(lint: &mut Lint<'_>, section: &Section<'_>, key: &str, object: Object) {
    let Some(entry) = section.value(key) else {
        lint.warning(section.line, Some(section.title), key, "is missing");
        return;
    };
    let Some(told) = read::unsigned::<u32>(section, key) else {
        lint.error(entry.line, Some(section.title), key, "not a number of 32 bits");
        return;
    };
    let default = lint.eds.object(object).and_then(|described| described.number);
    if let Some(default) = default.filter(|number| number.value != 0 && number.value != told.into())
    {
        let reason =
            format_args!("{told:08X}h, but the default of {object} is {:08X}h", default.value);
        lint.warning(entry.line, Some(section.title), key, reason);
    }
}

/// What can only be 0 or 1.
fn flags(lint: &mut Lint<'_>, section: &Section<'_>, is_flag: impl Fn(&str) -> bool) {
    for entry in section.entries.iter().filter(|entry| is_flag(entry.key)) {
        let value = value::whole(entry.word()).map(|(value, _)| value);
        if !matches!(value, Some(0 | 1)) {
            lint.warning(entry.line, Some(section.title), entry.key, "neither 0 nor 1");
        }
    }
}

fn number_of_pdos(lint: &mut Lint<'_>, section: &Section<'_>, key: &str, first: u16) {
    let Some(told) = read::integer(section, key) else { return };
    let range = first..first.saturating_add(512);
    let mut indices: Vec<_> =
        lint.eds.objects().iter().map(|described| described.object.index).collect();
    indices.dedup();
    let described = indices.into_iter().filter(|index| range.contains(index)).count();
    if i128::try_from(described) != Ok(told) {
        let reason = format_args!("{told}, but {described} are described");
        lint.warning(line_of(section, key), Some(section.title), key, reason);
    }
}

fn commissioning(lint: &mut Lint<'_>, section: &Section<'_>) {
    let told = lint.eds.commissioning();
    if told.is_some_and(|told| told.node.is_none()) {
        let line = line_of(section, "NodeID");
        lint.error(line, Some(section.title), "NodeID", "not 1 to 127");
    }
    let bitrate = told.and_then(|told| told.bitrate);
    if section.value("Baudrate").is_some() && !bitrate.is_some_and(|rate| BITRATES.contains(&rate))
    {
        let reason = format_args!("none of {BITRATES:?}, in kbit/s");
        lint.error(line_of(section, "Baudrate"), Some(section.title), "Baudrate", reason);
    }
}
