//! Checks within each object: mandatory entries, and values within type and limits (CiA 306, 4.6.3).

use crate::NodeId;
use crate::data_type::{self, DataType};
use crate::eds::eds_object::{Access, EdsObject};
use crate::eds::ini::{Entry, Section};
use crate::eds::lint::{Lint, Spot};
use crate::eds::title::Title;
use crate::eds::value::{self, NoValue, Number};
use crate::eds::{compact, read};
use crate::object::Object;

pub(super) fn check(lint: &mut Lint<'_>) {
    for section in lint.ini.first_sections() {
        match section.title {
            Title::Object(_) | Title::Sub(..) => one_object(lint, section),
            Title::Values(index) => values_of(lint, section, index),
            Title::Named(_)
            | Title::Names(_)
            | Title::Denotations(_)
            | Title::Links(_)
            | Title::Other(_) => {}
        }
    }
}

fn one_object(lint: &mut Lint<'_>, section: &Section<'_>) {
    if section.value("ParameterName").is_none() {
        lint.error(Spot::key(section, "ParameterName"), "is missing");
    }
    object_type(lint, section);
    let Some(described) = lint.described_by(section) else { return };
    type_and_access(lint, section, described);
    mappable(lint, section, described);
    if let Some(data_type) = data_type::find(described.data_type) {
        values(lint, section, described, &data_type);
    }
}

impl<'e> Lint<'e> {
    /// Returns the object, or the first of those, that a section describes; `None` for the head of an array or
    /// record with described sub-indices.
    fn described_by(&self, section: &Section<'_>) -> Option<&'e EdsObject> {
        let (index, sub) = match section.title {
            Title::Sub(index, sub) => return self.eds.object(Object { index, sub }),
            Title::Object(index) => (index, u8::from(compact::count(section) > 0)),
            Title::Values(index) => (index, 1),
            Title::Named(_)
            | Title::Names(_)
            | Title::Denotations(_)
            | Title::Links(_)
            | Title::Other(_) => return None,
        };
        let has_own = self.ini.section(Title::Sub(index, sub)).is_some();
        self.eds.object(Object { index, sub }).filter(|_| !has_own)
    }

    /// Returns whether the values of a section are texts.
    pub(super) fn is_text(&self, section: &Section<'_>) -> bool {
        self.described_by(section).is_some_and(|described| described.bits().is_none())
    }
}

fn object_type(lint: &mut Lint<'_>, section: &Section<'_>) {
    if section.value("ObjectType").is_none() {
        return;
    }
    let spot = Spot::key(section, "ObjectType");
    let is_sub = matches!(section.title, Title::Sub(..));
    match read::integer(section, "ObjectType") {
        None => lint.error(spot, "not a number: taken for VAR"),
        Some(read::RECORD_TYPE | read::ARRAY | read::RECORD) if is_sub => {
            lint.warning(spot, "a sub-index has no sub-indices: taken for VAR");
        }
        // NULL, DOMAIN, DEFTYPE, DEFSTRUCT, VAR, ARRAY, RECORD.
        Some(0 | 2 | 5..=9) => {}
        Some(other) => {
            lint.error(
                spot,
                format_args!("{other} is not an object type of CiA 301: taken for VAR"),
            );
        }
    }
}

/// Checks data type and access.
fn type_and_access(lint: &mut Lint<'_>, section: &Section<'_>, described: &EdsObject) {
    let spot = Spot::key(section, "DataType");
    let number = described.data_type;
    if number == 0 {
        lint.error(spot, "is missing or not a number");
    } else if data_type::find(number).is_none() {
        lint.error(spot, format_args!("{number:04X}h is not a data type of CiA 301"));
    }
    let spot = Spot::key(section, "AccessType");
    let known = "const, ro, wo, rw, rwr, rww";
    match section.value("AccessType").map(Entry::word) {
        None if number == data_type::DOMAIN => {}
        None => lint.error(spot, "is missing: taken for ro"),
        Some(word) if Access::read(word).is_none() => {
            lint.error(spot, format_args!("must be one of {known}, got \"{word}\": taken for ro"));
        }
        Some("r" | "R" | "w" | "W") => lint.warning(spot, format_args!("CiA 306 has {known}")),
        Some(_) => {}
    }
}

/// Checks that a mappable object fits a PDO.
fn mappable(lint: &mut Lint<'_>, section: &Section<'_>, described: &EdsObject) {
    let Some(word) = section.value("PDOMapping").map(Entry::word) else { return };
    let spot = Spot::key(section, "PDOMapping");
    let is_flag = matches!(value::whole(word), Some((0 | 1, _)));
    if !is_flag {
        let taken = u8::from(described.is_mappable);
        lint.warning(spot, format_args!("{word} is neither 0 nor 1: taken for {taken}"));
    }
    let Some(data_type) = data_type::find(described.data_type).filter(|_| described.is_mappable)
    else {
        return;
    };
    if data_type.bits.is_none() {
        // Devices map texts of a fixed length, which an EDS does not state.
        let reason =
            format_args!("a {} has no length by its type: no PDO maps it here", data_type.name);
        lint.warning(spot, reason);
    } else if described.access == Access::Constant {
        lint.warning(spot, "a constant is mapped in a PDO");
    }
}

/// Checks defaults, settings and limits.
fn values(lint: &mut Lint<'_>, section: &Section<'_>, described: &EdsObject, data_type: &DataType) {
    for key in ["LowLimit", "HighLimit"] {
        let Some(entry) = section.value(key).filter(|_| data_type.bits.is_some()) else { continue };
        if let Err(reason) = is_value(entry, data_type) {
            let spot = Spot::entry(section, entry);
            lint.error(spot, format_args!("{}: {reason}; not used", entry.word()));
        }
    }
    // Limits with the node-id on one side alone are compared for the first one.
    let resolved = |limit: Option<Number>| Some(limit?.resolve(NodeId::new(1).ok()?));
    if let (Some(low), Some(high)) = (resolved(described.low), resolved(described.high))
        && low > high
    {
        let spot = Spot::key(section, "LowLimit");
        lint.error(spot, format_args!("{low} is above the HighLimit, {high}"));
    }
    for key in ["DefaultValue", "ParameterValue"] {
        if let Some(entry) = section.value(key) {
            one_value(lint, Spot::entry(section, entry), entry, described, data_type);
        }
    }
}

/// Checks the values of compact sub-indices.
fn values_of(lint: &mut Lint<'_>, section: &Section<'_>, index: u16) {
    for entry in section.entries.iter().filter(|entry| !entry.value.is_empty()) {
        let sub = entry.key.parse().unwrap_or(0);
        let described = lint.eds.object(Object { index, sub }).filter(|_| sub > 0);
        if let Some(described) = described
            && let Some(data_type) = data_type::find(described.data_type)
        {
            one_value(lint, Spot::entry(section, entry), entry, described, &data_type);
        }
    }
}

/// Checks one value against type and limits.
fn one_value(
    lint: &mut Lint<'_>,
    spot: Spot<'_>,
    entry: &Entry<'_>,
    described: &EdsObject,
    data_type: &DataType,
) {
    let word = entry.word();
    match is_value(entry, data_type) {
        Ok(()) => {}
        Err(reason @ (NoValue::NotBytes | NoValue::NotLatin1)) => lint.warning(spot, reason),
        Err(reason) => lint.error(spot, format_args!("{word}: {reason}")),
    }
    let Ok(number) = value::number(word, data_type) else { return };
    // All sums are linear in the node-id, so checking the first and the last one suffices.
    let ends = [1, 127].into_iter().filter_map(|raw| NodeId::new(raw).ok());
    let exceeds = |limit: Option<Number>, is_beyond: fn(i128, i128) -> bool| {
        let limit = limit?;
        let first =
            ends.clone().find(|node| is_beyond(number.resolve(*node), limit.resolve(*node)));
        first.map(|node| limit.resolve(node))
    };
    if let Some(low) = exceeds(described.low, |value, low| value < low) {
        lint.error(spot, format_args!("{word} is below the LowLimit, {low}"));
    }
    if let Some(high) = exceeds(described.high, |value, high| value > high) {
        lint.error(spot, format_args!("{word} is above the HighLimit, {high}"));
    }
}

fn is_value(entry: &Entry<'_>, data_type: &DataType) -> Result<(), NoValue> {
    if data_type.range().is_some() {
        return value::number(entry.word(), data_type).map(|_| ());
    }
    // The other types do not depend on the node-id.
    match NodeId::new(1) {
        Ok(node) => value::bytes(entry.value, data_type, node).map(|_| ()),
        Err(_) => Ok(()),
    }
}
