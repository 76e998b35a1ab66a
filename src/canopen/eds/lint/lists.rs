//! Lists of objects (CiA 306, 4.5.2), and consistency of listed, counted and described objects.

use std::collections::{BTreeSet, HashMap};

use crate::data_type::UNSIGNED8;
use crate::eds::ini::{Entry, Section};
use crate::eds::lint::{Gap, Lint, Spot};
use crate::eds::title::{Heading, Title};
use crate::eds::{compact, read, value};
use crate::object::Object;

/// First index of objects; data types are below.
const FIRST_OBJECT: u16 = 0x1000;

/// List that contains each object, by index.
type ListIndex = HashMap<u16, Heading>;

pub(super) fn check(lint: &mut Lint<'_>) {
    let mut listed = ListIndex::new();
    for list in Heading::LISTS {
        match lint.ini.section(Title::Named(list)) {
            Some(section) => one_list(lint, list, section, &mut listed),
            None if list == Heading::Mandatory => {
                lint.error(Spot::missing(Title::Named(list)), "is missing");
            }
            None => {}
        }
    }
    let Object { index, sub } = Object::VENDOR_ID;
    for (object, title) in [
        (Object::DEVICE_TYPE, Title::Object(Object::DEVICE_TYPE.index)),
        (Object::ERROR_REGISTER, Title::Object(Object::ERROR_REGISTER.index)),
        (Object::VENDOR_ID, Title::Sub(index, sub)),
    ] {
        if lint.eds.object(object).is_none() {
            lint.error(Spot::missing(title), "is mandatory, but not described");
        }
    }
    sections(lint, &listed);
}

/// Checks that every object is in a list, and every sub-index in an object.
fn sections(lint: &mut Lint<'_>, listed: &ListIndex) {
    let subs = sub_sections(lint);
    for section in lint.ini.first_sections() {
        let spot = Spot::section(section);
        match section.title {
            Title::Object(index) => {
                if index >= FIRST_OBJECT && !listed.contains_key(&index) {
                    lint.warning(spot, "is in no list of objects");
                }
                head(lint, section, index, subs.get(&index).map_or(&[], Vec::as_slice));
            }
            Title::Sub(index, _) if lint.ini.section(Title::Object(index)).is_none() => {
                lint.error(spot, format_args!("there is no [{index:04X}]"));
            }
            Title::Names(index) | Title::Values(index) | Title::Denotations(index) => {
                compact_entries(lint, section, index);
            }
            Title::Named(_) | Title::Sub(..) | Title::Links(_) | Title::Other(_) => {}
        }
    }
}

/// Sub-indices with sections, by object, in order.
fn sub_sections(lint: &Lint<'_>) -> HashMap<u16, Vec<u8>> {
    let mut subs: HashMap<u16, Vec<u8>> = HashMap::new();
    for section in lint.ini.first_sections() {
        if let Title::Sub(index, sub) = section.title {
            subs.entry(index).or_default().push(sub);
        }
    }
    subs.values_mut().for_each(|subs| subs.sort_unstable());
    subs
}

/// Checks one list: its objects, count and enumeration.
fn one_list(lint: &mut Lint<'_>, list: Heading, section: &Section<'_>, listed: &mut ListIndex) {
    let mut numbers = BTreeSet::new();
    for entry in &section.entries {
        if let Ok(number) = entry.key.parse::<u32>() {
            numbers.insert(number);
            listed_object(lint, list, Spot::entry(section, entry), entry, listed);
        }
    }
    let spot = Spot::key(section, "SupportedObjects");
    let Some(count) = read::integer(section, "SupportedObjects") else {
        lint.error(spot, "is missing or not a number");
        return;
    };
    let gap = (1..).zip(&numbers).find(|(wanted, found)| wanted != *found);
    let listed = i128::try_from(numbers.len()).unwrap_or(i128::MAX);
    if listed < count {
        lint.gap(spot, Gap::Count, format_args!("{count}, but {listed} are listed"));
    } else if listed > count {
        lint.error(spot, format_args!("{count}, but {listed} are listed"));
    } else if let Some((wanted, found)) = gap {
        lint.error(spot, format_args!("number {wanted} is missing, next is {found}"));
    }
}

/// Checks a listed object: described, listed once, and in the right list.
fn listed_object(
    lint: &mut Lint<'_>,
    list: Heading,
    spot: Spot<'_>,
    entry: &Entry<'_>,
    listed: &mut ListIndex,
) {
    let index = value::whole(entry.word()).and_then(|(index, _)| u16::try_from(index).ok());
    let Some(index) = index else {
        lint.error(spot, "not an object index");
        return;
    };
    let has_objects =
        || lint.eds.objects().binary_search_by_key(&index, |one| one.object.index).is_ok();
    if lint.ini.section(Title::Object(index)).is_none() && !has_objects() {
        let reason = format_args!("{index:04X}h is listed, but there is no [{index:04X}]");
        lint.gap(spot, Gap::Object(index), reason);
    }
    if listed.insert(index, list).is_some() {
        lint.warning(spot, format_args!("{index:04X}h is listed twice"));
    }
    let home = Heading::list_of(index);
    if home != list {
        lint.warning(spot, format_args!("{index:04X}h belongs in [{}]", home.name()));
    }
}

/// Checks the head of an object: its sub-indices must match its count.
fn head(lint: &mut Lint<'_>, section: &Section<'_>, index: u16, subs: &[u8]) {
    if compact::count(section) > 0 {
        compact_head(lint, section);
        return;
    }
    if section.value("CompactSubObj").is_some()
        && read::integer(section, "CompactSubObj") != Some(0)
    {
        lint.error(Spot::key(section, "CompactSubObj"), "must be within 0..=254");
    }
    if !read::is_head(section) && !subs.is_empty() {
        let reason = "must be an array or record, as there are sub-indices";
        lint.error(Spot::key(section, "ObjectType"), reason);
    }
    let spot = Spot::key(section, "SubNumber");
    match (section.value("SubNumber"), read::integer(section, "SubNumber")) {
        (Some(_), None) => lint.error(spot, "not a number"),
        (Some(_), Some(count)) if i128::try_from(subs.len()) != Ok(count) => {
            let reason = format!("{count}, but {} sub-indices are described", subs.len());
            let is_gap = i128::try_from(subs.len()).is_ok_and(|there| there < count);
            if is_gap {
                lint.gap(spot, Gap::Object(index), reason);
            } else {
                lint.error(spot, reason);
            }
        }
        (None, _) if !subs.is_empty() => lint.warning(spot, "is missing"),
        (None, _) if read::is_head(section) => {
            lint.error(Spot::section(section), "has no sub-indices: not read");
        }
        (Some(_) | None, _) => {}
    }
    match (subs, subs.iter().rfind(|sub| **sub < u8::MAX)) {
        ([0, ..], Some(last)) => highest_sub_index(lint, index, *last),
        ([_, ..], _) => lint.error(Spot::section(section), "has no sub-index 0"),
        ([], _) => {}
    }
}

/// Checks the head of a compact array.
fn compact_head(lint: &mut Lint<'_>, section: &Section<'_>) {
    if read::integer(section, "SubNumber").is_some_and(|number| number > 0) {
        let spot = Spot::key(section, "SubNumber");
        lint.error(spot, "is invalid beside CompactSubObj");
    }
    if !read::is_head(section) {
        let spot = Spot::key(section, "ObjectType");
        lint.warning(spot, "is not that of an array, but CompactSubObj makes it one");
    }
}

/// Checks sub-index 0, the highest sub-index. In mappings and histories it counts the entries in use.
fn highest_sub_index(lint: &mut Lint<'_>, index: u16, last: u8) {
    let Some(described) = lint.eds.object(Object { index, sub: 0 }) else { return };
    if described.data_type != UNSIGNED8 {
        let spot = lint.spot(described.object, "DataType");
        lint.warning(spot, "sub-index 0 is UNSIGNED8 (0x0005) by CiA 301");
    }
    let Some(number) = described.number.filter(|number| !number.plus_node_id) else { return };
    let is_history = index == Object::ERROR_HISTORY.index;
    let is_count = described.access.is_writable() || is_mapping(index) || is_history;
    let (stated, last) = (number.value, i128::from(last));
    if stated != last && !(is_count && stated < last) {
        let spot = lint.spot(described.object, "DefaultValue");
        lint.warning(spot, format_args!("{stated}, but the highest sub-index described is {last}"));
    }
}

/// Returns whether an index is that of a mapping parameter.
fn is_mapping(index: u16) -> bool {
    let within = |first: u16| (first..first.saturating_add(512)).contains(&index);
    within(Object::rpdo_mapping(1, 0).index) || within(Object::tpdo_mapping(1, 0).index)
}

/// Checks names, values or denotations of compact sub-indices.
fn compact_entries(lint: &mut Lint<'_>, section: &Section<'_>, index: u16) {
    let count = lint.ini.section(Title::Object(index)).map_or(0, compact::count);
    if count == 0 {
        let reason = format_args!("[{index:04X}] has no CompactSubObj: not read");
        lint.warning(Spot::section(section), reason);
        return;
    }
    let there = compact::by_sub(Some(section)).len();
    if let Some(stated) = read::integer(section, "NrOfEntries")
        && i128::try_from(there) != Ok(stated)
    {
        let spot = Spot::key(section, "NrOfEntries");
        lint.warning(spot, format_args!("{stated}, but there are {there}"));
    }
    for entry in &section.entries {
        if entry.key.parse::<u8>().is_ok_and(|sub| sub == 0 || sub > count) {
            let spot = Spot::entry(section, entry);
            lint.warning(spot, format_args!("there are sub-indices 1 to {count}"));
        }
    }
}
