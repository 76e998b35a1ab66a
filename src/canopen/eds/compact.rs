//! Compact descriptions (CiA 306): arrays by `CompactSubObj`, PDOs by `CompactPDO`.

use std::collections::{HashMap, HashSet};

use crate::data_type::{self, UNSIGNED8, UNSIGNED32};
use crate::eds::eds_object::{Access, DcfEntries, EdsObject};
use crate::eds::ini::{Entry, Ini, Section};
use crate::eds::read;
use crate::eds::title::{Heading, Title};
use crate::eds::value::{self, Number};
use crate::object::Object;

/// Number of sub-indices described compactly, 0 to 254.
pub(super) fn count(section: &Section<'_>) -> u8 {
    read::unsigned(section, "CompactSubObj").filter(|count| *count != u8::MAX).unwrap_or(0)
}

/// Appends an array of `count` equal entries. Sub-indices with their own sections are skipped; names and values
/// come from `[xxxxName]`, `[xxxxValue]` and `[xxxxDenotation]`.
pub(super) fn array(
    ini: &Ini<'_>,
    section: &Section<'_>,
    index: u16,
    count: u8,
    objects: &mut Vec<EdsObject>,
) {
    let model = read::one(ini, section, Object { index, sub: 1 });
    let data_type = data_type::find(model.data_type);
    let names = by_sub(ini.section(Title::Names(index)));
    let values = by_sub(ini.section(Title::Values(index)));
    let denotations = by_sub(ini.section(Title::Denotations(index)));
    let has_own = |sub| ini.section(Title::Sub(index, sub)).is_some();
    if !has_own(0) {
        objects.push(plain(
            Object { index, sub: 0 },
            "NrOfObjects",
            UNSIGNED8,
            Access::ReadOnly,
            count.into(),
        ));
    }
    for sub in (1..=count).filter(|sub| !has_own(*sub)) {
        let name = names.get(&sub).map(|entry| entry.value.to_owned());
        let value = values.get(&sub).map(|entry| read::text_of(entry, data_type));
        let denotation = denotations.get(&sub).map(|entry| entry.value.to_owned());
        let setting = DcfEntries {
            value: value.or_else(|| model.setting.value.clone()),
            denotation,
            ..model.setting.clone()
        };
        objects.push(EdsObject {
            object: Object { index, sub },
            name: name.unwrap_or_else(|| format!("{}{sub}", model.name)),
            setting,
            ..model.clone()
        });
    }
}

/// Entries of a section whose keys are decimal sub-indices.
pub(super) fn by_sub<'s, 't>(section: Option<&'s Section<'t>>) -> HashMap<u8, &'s Entry<'t>> {
    let mut found = HashMap::new();
    for entry in section.iter().flat_map(|section| &section.entries) {
        if let Ok(sub) = entry.key.parse::<u8>()
            && !entry.value.is_empty()
        {
            found.entry(sub).or_insert(entry);
        }
    }
    found
}

/// Returns an object without further properties.
fn plain(object: Object, name: &str, data_type: u16, access: Access, value: i128) -> EdsObject {
    let data = data_type::find(data_type);
    let bytes = value.to_le_bytes();
    let text = data.and_then(|data| value::text(bytes.get(..data.bytes()?)?, &data));
    EdsObject {
        object,
        name: name.to_owned(),
        data_type,
        access,
        default: text.unwrap_or_default(),
        number: Some(Number { value, plus_node_id: false }),
        low: None,
        high: None,
        is_mappable: false,
        flags: 0,
        setting: DcfEntries::default(),
    }
}

/// Maximum number of PDOs per direction.
const MAX_PDOS: u16 = 512;

/// Maximum number of mapping entries.
const MAX_ENTRIES: u8 = 64;

/// Per direction: key of the number of PDOs, parameters of the first one, and its default COB-ID.
const DIRECTIONS: [(&str, Object, Object, u32); 2] = [
    ("NrOfRXPDO", Object::rpdo_communication(1, 0), Object::rpdo_mapping(1, 0), 0x200),
    ("NrOfTXPDO", Object::tpdo_communication(1, 0), Object::tpdo_mapping(1, 0), 0x180),
];

/// Sub-indices 1 to 6 of a communication parameter, with name and type (CiA 301, 7.5.2.35).
const COMMUNICATION: [(u8, &str, u16); 6] = [
    (1, "COB-ID", UNSIGNED32),
    (2, "Transmission type", UNSIGNED8),
    (3, "Inhibit time", 0x06),
    (4, "Reserved", UNSIGNED8),
    (5, "Event timer", 0x06),
    (6, "SYNC start value", UNSIGNED8),
];

/// Appends the PDOs that `NrOfRXPDO` and `NrOfTXPDO` count but no section describes. `CompactPDO` is a mask of
/// the sub-indices of their communication parameters; zero means none.
pub(super) fn pdos(ini: &Ini<'_>, objects: &mut Vec<EdsObject>) {
    let Some(device) = ini.section(Title::Named(Heading::DeviceInfo)) else { return };
    let mask: u8 = read::unsigned(device, "CompactPDO").unwrap_or(0);
    if mask == 0 {
        return;
    }
    let known: HashSet<u16> = objects.iter().map(|described| described.object.index).collect();
    for (key, communication, mapping, cob_id) in DIRECTIONS {
        let (communication, mapping) = (communication.index, mapping.index);
        let wanted: u16 = read::unsigned(device, key).unwrap_or(0).min(MAX_PDOS);
        let is_described =
            |pdo: &u16| known.contains(&(communication + pdo)) || known.contains(&(mapping + pdo));
        let described = (0..MAX_PDOS).filter(is_described).count();
        let missing = usize::from(wanted).saturating_sub(described);
        for pdo in (0..MAX_PDOS).filter(|pdo| !is_described(pdo)).take(missing) {
            communication_parameter(
                communication + pdo,
                mask,
                default_cob_id(cob_id, pdo),
                objects,
            );
            mapping_parameter(mapping + pdo, objects);
        }
    }
}

/// Default COB-ID of a PDO; after the fourth, PDOs are disabled.
fn default_cob_id(first: u32, pdo: u16) -> Number {
    if pdo < 4 {
        Number { value: i128::from(first) + 0x100 * i128::from(pdo), plus_node_id: true }
    } else {
        Number { value: 1 << 31, plus_node_id: false }
    }
}

fn communication_parameter(index: u16, mask: u8, cob_id: Number, objects: &mut Vec<EdsObject>) {
    let subs = COMMUNICATION.into_iter().filter(|(sub, ..)| mask >> sub & 1 == 1);
    let highest = subs.clone().map(|(sub, ..)| sub).max().unwrap_or(0);
    objects.push(plain(
        Object { index, sub: 0 },
        "Highest sub-index",
        UNSIGNED8,
        Access::Constant,
        highest.into(),
    ));
    for (sub, name, data_type) in subs {
        let mut described = plain(Object { index, sub }, name, data_type, Access::ReadWrite, 0);
        if sub == 1 {
            let node_id = if cob_id.plus_node_id { "$NODEID+" } else { "" };
            described.default = format!("{node_id}0x{:X}", cob_id.value);
            described.number = Some(cob_id);
        }
        objects.push(described);
    }
}

fn mapping_parameter(index: u16, objects: &mut Vec<EdsObject>) {
    objects.push(plain(
        Object { index, sub: 0 },
        "Number of mapped objects",
        UNSIGNED8,
        Access::ReadWrite,
        0,
    ));
    for sub in 1..=MAX_ENTRIES {
        let name = format!("Mapped object {sub}");
        objects.push(plain(Object { index, sub }, &name, UNSIGNED32, Access::ReadWrite, 0));
    }
}
