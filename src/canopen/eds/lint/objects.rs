//! Every object by itself: what must be said of it, and whether its values are of its type and within
//! its limits (CiA 306, 4.6.3).

use crate::canopen::NodeId;
use crate::canopen::data_type;
use crate::canopen::data_type::DataType;
use crate::canopen::data_type::Kind;
use crate::canopen::eds::compact;
use crate::canopen::eds::described::Access;
use crate::canopen::eds::described::Described;
use crate::canopen::eds::ini::Entry;
use crate::canopen::eds::ini::Section;
use crate::canopen::eds::lint::Lint;
use crate::canopen::eds::lint::line_of;
use crate::canopen::eds::read;
use crate::canopen::eds::title::Title;
use crate::canopen::eds::value;
use crate::canopen::eds::value::NoValue;
use crate::canopen::object::Object;

pub(super) fn check(lint: &mut Lint<'_>) {
    for section in lint.ini.first_sections() {
        let object = match section.title {
            Title::Sub(index, sub) => Object { index, sub },
            Title::Object(index) if compact::count(section) > 0 => {
                values_of(lint, index);
                Object { index, sub: 1 }
            }
            Title::Object(index) => Object { index, sub: 0 },
            Title::Named(_)
            | Title::Names(_)
            | Title::Values(_)
            | Title::Denotations(_)
            | Title::Links(_)
            | Title::Other(_) => continue,
        };
        if section.value("ParameterName").is_none() {
            let line = line_of(section, "ParameterName");
            lint.error(line, Some(section.title), "ParameterName", "is missing");
        }
        object_type(lint, section);
        // A head has no type of its own, but where it stands for all its entries it has.
        let stands_alone =
            matches!(section.title, Title::Sub(..)) || lint.has_values(section, object);
        if let Some(described) = lint.eds.object(object).filter(|_| stands_alone) {
            said(lint, section, described);
            mappable(lint, section, described);
            if let Some(data_type) = data_type::of(described.data_type) {
                values(lint, section, described, &data_type);
            }
        }
    }
}

impl Lint<'_> {
    /// Whether a section with an index alone describes values, not an array or record.
    fn has_values(&self, section: &Section<'_>, object: Object) -> bool {
        let has_subs = self.ini.section(Title::Sub(object.index, object.sub)).is_some();
        compact::count(section) > 0 || !(read::is_head(section) || has_subs)
    }

    /// Whether the values of a section are texts.
    pub(super) fn is_text(&self, section: &Section<'_>) -> bool {
        let object = match section.title {
            Title::Sub(index, sub) => Object { index, sub },
            Title::Object(index) | Title::Values(index) => {
                let var = Object { index, sub: 0 };
                let is_var = self.has_values(section, var) && compact::count(section) == 0;
                if is_var { var } else { Object { index, sub: 1 } }
            }
            Title::Named(_)
            | Title::Names(_)
            | Title::Denotations(_)
            | Title::Links(_)
            | Title::Other(_) => return false,
        };
        self.eds.object(object).is_some_and(|described| described.bits().is_none())
    }
}

fn object_type(lint: &mut Lint<'_>, section: &Section<'_>) {
    let Some(entry) = section.value("ObjectType") else { return };
    let title = Some(section.title);
    match read::integer(section, "ObjectType") {
        None => lint.error(entry.line, title, entry.key, "not a number: taken for VAR"),
        Some(read::VAR | read::DOMAIN_OBJECT) => {}
        Some(read::RECORD_TYPE | read::ARRAY | read::RECORD) => {
            if matches!(section.title, Title::Sub(..)) {
                lint.warning(
                    entry.line,
                    title,
                    entry.key,
                    "a sub-index has no sub-indices: taken for VAR",
                );
            }
        }
        Some(0 | 5) => {}
        Some(other) => lint.error(
            entry.line,
            title,
            entry.key,
            format_args!("{other} is no object type of CiA 301: taken for VAR"),
        ),
    }
}

/// Type and access must be said, in words that mean something.
fn said(lint: &mut Lint<'_>, section: &Section<'_>, described: &Described) {
    let title = Some(section.title);
    let line = line_of(section, "DataType");
    if described.data_type == 0 {
        lint.error(line, title, "DataType", "is missing, or no number");
    } else if data_type::of(described.data_type).is_none() {
        let reason = format_args!("{:04X}h is no data type of CiA 301", described.data_type);
        lint.error(line, title, "DataType", reason);
    }
    match section.value("AccessType") {
        None if described.data_type == data_type::DOMAIN => {}
        None => {
            let line = line_of(section, "AccessType");
            lint.error(line, title, "AccessType", "is missing: taken for ro");
        }
        Some(entry) if Access::read(entry.word()).is_none() => {
            let reason = format_args!(
                "\"{}\" is none of const, ro, wo, rw, rwr, rww: taken for ro",
                entry.word()
            );
            lint.error(entry.line, title, entry.key, reason);
        }
        Some(entry) if entry.word().len() < 2 => {
            lint.warning(entry.line, title, entry.key, "CiA 306 has const, ro, wo, rw, rwr, rww");
        }
        Some(_) => {}
    }
}

/// What may be mapped must be able to be in a PDO.
fn mappable(lint: &mut Lint<'_>, section: &Section<'_>, described: &Described) {
    let title = Some(section.title);
    let Some(entry) = section.value("PDOMapping") else { return };
    let is_word =
        entry.word().eq_ignore_ascii_case("true") || entry.word().eq_ignore_ascii_case("false");
    match value::whole(entry.word()) {
        Some((0 | 1, _)) => {}
        None if !is_word => {
            lint.error(entry.line, title, entry.key, "neither 0 nor 1: taken for 0")
        }
        Some(_) | None => lint.warning(entry.line, title, entry.key, "neither 0 nor 1"),
    }
    if !described.is_mappable {
        return;
    }
    match data_type::of(described.data_type) {
        Some(data_type) if data_type.bits.is_none() => {
            lint.error(
                entry.line,
                title,
                entry.key,
                format_args!("a {} cannot be in a PDO", data_type.name),
            );
        }
        Some(_) if described.access == Access::Constant => {
            lint.warning(entry.line, title, entry.key, "a constant in a PDO says nothing");
        }
        Some(_) | None => {}
    }
}

/// Defaults, settings and limits.
fn values(lint: &mut Lint<'_>, section: &Section<'_>, described: &Described, data_type: &DataType) {
    let title = Some(section.title);
    for key in ["LowLimit", "HighLimit"] {
        let Some(entry) = section.value(key) else { continue };
        let limit = if data_type.bits.is_some() { is_value(entry, data_type) } else { Ok(()) };
        if let Err(reason) = limit {
            lint.error(
                entry.line,
                title,
                key,
                format_args!("{}: {reason}; not used", entry.word()),
            );
        }
    }
    if let (Some(low), Some(high)) = (described.low, described.high)
        && low > high
    {
        let line = line_of(section, "LowLimit");
        lint.error(line, title, "LowLimit", format_args!("{low} is above the HighLimit, {high}"));
    }
    for key in ["DefaultValue", "ParameterValue"] {
        if let Some(entry) = section.value(key) {
            one_value(lint, section, entry, key, described, data_type);
        }
    }
}

/// One value must be of its type and within the limits.
fn one_value(
    lint: &mut Lint<'_>,
    section: &Section<'_>,
    entry: &Entry<'_>,
    key: &str,
    described: &Described,
    data_type: &DataType,
) {
    let title = Some(section.title);
    match is_value(entry, data_type) {
        Ok(()) => {}
        Err(reason @ (NoValue::NotBytes | NoValue::NotLatin1)) => {
            lint.warning(entry.line, title, key, reason);
            return;
        }
        Err(reason) => {
            lint.error(entry.line, title, key, format_args!("{}: {reason}", entry.word()));
            return;
        }
    }
    let Ok(number) = value::number(entry.word(), data_type) else { return };
    let all_ids = if number.plus_node_id { 1..=127 } else { 0..=0 };
    let values = number.value + all_ids.start()..=number.value + all_ids.end();
    if let Some(low) = described.low.filter(|low| values.start() < low) {
        lint.error(
            entry.line,
            title,
            key,
            format_args!("{} is below the LowLimit, {low}", entry.word()),
        );
    }
    if let Some(high) = described.high.filter(|high| values.end() > high) {
        lint.error(
            entry.line,
            title,
            key,
            format_args!("{} is above the HighLimit, {high}", entry.word()),
        );
    }
}

fn is_value(entry: &Entry<'_>, data_type: &DataType) -> Result<(), NoValue> {
    if matches!(data_type.kind, Kind::Boolean | Kind::Signed | Kind::Unsigned) {
        return value::number(entry.word(), data_type).map(|_| ());
    }
    // The other types do not depend on the node-id.
    match NodeId::new(1) {
        Ok(node) => value::bytes(entry.value, data_type, node).map(|_| ()),
        Err(_) => Ok(()),
    }
}

/// The values of what is told compactly.
fn values_of(lint: &mut Lint<'_>, index: u16) {
    let Some(section) = lint.ini.section(Title::Values(index)) else { return };
    for entry in &section.entries {
        let Ok(sub) = entry.key.parse::<u8>() else { continue };
        let Some(described) = lint.eds.object(Object { index, sub }).filter(|_| sub > 0) else {
            continue;
        };
        if let Some(data_type) =
            data_type::of(described.data_type).filter(|_| !entry.value.is_empty())
        {
            one_value(lint, section, entry, entry.key, described, &data_type);
        }
    }
}
