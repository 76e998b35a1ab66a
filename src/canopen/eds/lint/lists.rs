//! The lists of objects (CiA 306, 4.5.2), and whether what is listed, counted and described agree.

use std::collections::BTreeMap;
use std::collections::HashMap;

use crate::canopen::data_type::UNSIGNED8;
use crate::canopen::eds::compact;
use crate::canopen::eds::ini::Section;
use crate::canopen::eds::lint::Lint;
use crate::canopen::eds::lint::line_of;
use crate::canopen::eds::read;
use crate::canopen::eds::title::Named;
use crate::canopen::eds::title::Title;
use crate::canopen::eds::value;
use crate::canopen::object::Object;

/// Where the objects proper begin; below are data types.
const FIRST_OBJECT: u16 = 0x1000;

pub(super) fn check(lint: &mut Lint<'_>) {
    let mut listed = HashMap::new();
    for list in Named::LISTS {
        match lint.ini.section(Title::Named(list)) {
            Some(section) => one_list(lint, list, section, &mut listed),
            None if list == Named::Mandatory => {
                lint.error(1, Some(Title::Named(list)), "", "is missing");
            }
            None => {}
        }
    }
    for object in [Object::DEVICE_TYPE, Object::ERROR_REGISTER, Object::VENDOR_ID] {
        if lint.eds.object(object).is_none() {
            let title = if object.sub == 0 {
                Title::Object(object.index)
            } else {
                Title::Sub(object.index, object.sub)
            };
            lint.error(1, Some(title), "", "is mandatory, but not described");
        }
    }
    let subs = sub_sections(lint);
    for section in lint.ini.first_sections() {
        match section.title {
            Title::Object(index) => {
                if index >= FIRST_OBJECT && !listed.contains_key(&index) {
                    lint.warning(section.line, Some(section.title), "", "is in no list of objects");
                }
                head(lint, section, index, subs.get(&index).map_or(&[], Vec::as_slice));
            }
            Title::Sub(index, _) if lint.ini.section(Title::Object(index)).is_none() => {
                lint.error(
                    section.line,
                    Some(section.title),
                    "",
                    format_args!("there is no [{index:04X}]"),
                );
            }
            Title::Names(index) | Title::Values(index) | Title::Denotations(index) => {
                compact_entries(lint, section, index);
            }
            Title::Named(_) | Title::Sub(..) | Title::Links(_) | Title::Other(_) => {}
        }
    }
}

/// The sub-indices that have sections, of each object, in order.
fn sub_sections(lint: &Lint<'_>) -> BTreeMap<u16, Vec<u8>> {
    let mut subs: BTreeMap<u16, Vec<u8>> = BTreeMap::new();
    for section in lint.ini.first_sections() {
        if let Title::Sub(index, sub) = section.title {
            subs.entry(index).or_default().push(sub);
        }
    }
    subs.values_mut().for_each(|subs| subs.sort_unstable());
    subs
}

/// One list: its count, its enumeration, and every object in it.
fn one_list(
    lint: &mut Lint<'_>,
    list: Named,
    section: &Section<'_>,
    listed: &mut HashMap<u16, Named>,
) {
    let title = Some(section.title);
    let mut places = BTreeMap::new();
    for entry in &section.entries {
        let Ok(place) = entry.key.parse::<u32>() else { continue };
        places.entry(place).or_insert(entry);
        let Some(index) =
            value::whole(entry.word()).and_then(|(value, _)| u16::try_from(value).ok())
        else {
            lint.error(entry.line, title, entry.key, "no index of an object");
            continue;
        };
        let is_described = lint.ini.section(Title::Object(index)).is_some()
            || lint.eds.objects().binary_search_by_key(&index, |one| one.object.index).is_ok();
        if !is_described {
            lint.error(
                entry.line,
                title,
                entry.key,
                format_args!("{index:04X}h is listed, but there is no [{index:04X}]"),
            );
        }
        if listed.insert(index, list).is_some() {
            lint.warning(
                entry.line,
                title,
                entry.key,
                format_args!("{index:04X}h is listed twice"),
            );
        }
        let home = Named::list_of(index);
        if home != list {
            let reason = format_args!("{index:04X}h belongs in [{}]", home.name());
            lint.warning(entry.line, title, entry.key, reason);
        }
    }
    let key = "SupportedObjects";
    let line = line_of(section, key);
    let Some(count) = read::integer(section, key) else {
        lint.error(line, title, key, "is missing, or no number");
        return;
    };
    if i128::try_from(places.len()) != Ok(count) {
        lint.error(line, title, key, format_args!("{count}, but {} are listed", places.len()));
    } else if let Some((wanted, found)) =
        (1..).zip(places.keys()).find(|(wanted, found)| wanted != *found)
    {
        lint.error(line, title, key, format_args!("number {wanted} is missing, {found} is there"));
    }
}

/// The head of an array or record: how many sub-indices it says it has.
fn head(lint: &mut Lint<'_>, section: &Section<'_>, index: u16, subs: &[u8]) {
    let title = Some(section.title);
    let compact = compact::count(section);
    if let Some(entry) = section.value("CompactSubObj")
        && compact == 0
        && read::integer(section, "CompactSubObj") != Some(0)
    {
        lint.error(entry.line, title, entry.key, "not 0 to 254");
    }
    let number =
        section.value("SubNumber").map(|entry| (entry.line, read::integer(section, "SubNumber")));
    if compact > 0 {
        if let Some((line, Some(1..))) = number {
            lint.error(line, title, "SubNumber", "cannot be there beside CompactSubObj");
        }
        if !read::is_head(section) {
            lint.warning(
                line_of(section, "ObjectType"),
                title,
                "ObjectType",
                "is not that of an array, but CompactSubObj makes it one",
            );
        }
        return;
    }
    if !read::is_head(section) && !subs.is_empty() {
        lint.error(
            line_of(section, "ObjectType"),
            title,
            "ObjectType",
            "is not that of an array or record, but there are sub-indices",
        );
    }
    match number {
        Some((line, None)) => lint.error(line, title, "SubNumber", "not a number"),
        Some((line, Some(told))) if i128::try_from(subs.len()) != Ok(told) => {
            lint.error(
                line,
                title,
                "SubNumber",
                format_args!("{told}, but {} sub-indices are described", subs.len()),
            );
        }
        None if !subs.is_empty() => lint.warning(section.line, title, "SubNumber", "is missing"),
        None if read::is_head(section) => {
            lint.error(section.line, title, "", "has no sub-indices: not read")
        }
        Some(_) | None => {}
    }
    if let (Some(first), Some(last)) = (subs.first(), subs.iter().rfind(|sub| **sub < u8::MAX)) {
        if *first == 0 {
            highest_sub_index(lint, index, *last);
        } else {
            lint.error(section.line, title, "", "has no sub-index 0");
        }
    }
}

/// Sub-index 0, which says the highest there is. Mappings and histories say how many are in use.
fn highest_sub_index(lint: &mut Lint<'_>, index: u16, last: u8) {
    let Some(described) = lint.eds.object(Object { index, sub: 0 }) else { return };
    let title = Some(Title::Sub(index, 0));
    if described.data_type != UNSIGNED8 {
        let (line, _) = lint.place(described.object, "DataType");
        lint.warning(line, title, "DataType", "sub-index 0 is UNSIGNED8 (0x0005) by CiA 301");
    }
    let Some(number) = described.number.filter(|number| !number.plus_node_id) else { return };
    let is_count =
        described.access.is_writable() || is_mapping(index) || index == Object::ERROR_HISTORY.index;
    let is_right =
        number.value == i128::from(last) || (is_count && number.value < i128::from(last));
    if !is_right {
        let (line, _) = lint.place(described.object, "DefaultValue");
        let reason =
            format_args!("{}, but the highest sub-index described is {last}", number.value);
        lint.warning(line, title, "DefaultValue", reason);
    }
}

/// Whether an index is that of a mapping parameter.
pub(super) fn is_mapping(index: u16) -> bool {
    let within = |first: u16| (first..first.saturating_add(512)).contains(&index);
    within(Object::rpdo_mapping(1, 0).index) || within(Object::tpdo_mapping(1, 0).index)
}

/// Names, values or denotations of what is told compactly.
fn compact_entries(lint: &mut Lint<'_>, section: &Section<'_>, index: u16) {
    let title = Some(section.title);
    let head = lint.ini.section(Title::Object(index));
    let count = head.map_or(0, compact::count);
    if count == 0 {
        let reason = format_args!("[{index:04X}] has no CompactSubObj: not read");
        lint.warning(section.line, title, "", reason);
        return;
    }
    let entries = compact::by_sub(Some(section));
    if let Some(told) = read::integer(section, "NrOfEntries")
        && i128::try_from(entries.len()) != Ok(told)
    {
        let line = line_of(section, "NrOfEntries");
        lint.warning(
            line,
            title,
            "NrOfEntries",
            format_args!("{told}, but there are {}", entries.len()),
        );
    }
    for entry in &section.entries {
        if entry.key.parse::<u8>().is_ok_and(|sub| sub == 0 || sub > count) {
            lint.warning(
                entry.line,
                title,
                entry.key,
                format_args!("there are sub-indices 1 to {count}"),
            );
        }
    }
}
