//! Sections of an EDS, to change and write (CiA 306), with Windows line ends. Known sections and keys have the standard's order
//! and spelling; unknown ones follow.

use std::borrow::Cow;
use std::collections::HashSet;

use canopen::eds::ini::Section;
use canopen::eds::title::{Heading, Title};
use canopen::eds::{self, Eds, EdsObject, keys};
use canopen::object::Object;

/// Sections of a file.
#[derive(Clone, Debug)]
pub struct Sheet<'t> {
    sections: Vec<Part<'t>>,
}

/// Section with its entries.
#[derive(Clone, Debug)]
struct Part<'t> {
    name: String,
    entries: Vec<(Cow<'t, str>, Cow<'t, str>)>,
}

impl<'t> Sheet<'t> {
    /// Collects the effective entries: the first section of each name, in it the first entry of each key.
    pub fn from_eds(eds: &'t Eds) -> Self {
        Self { sections: eds.ini().first_sections().map(part).collect() }
    }

    /// Sets or adds an entry of `[FileInfo]`.
    pub fn set_file_info(&mut self, key: &str, value: &str) {
        self.set(Title::Named(Heading::FileInfo), key, value);
    }

    /// Returns the value of a key of `[FileInfo]`.
    pub fn file_info(&self, key: &str) -> Option<&str> {
        self.get(Title::Named(Heading::FileInfo), key)
    }

    /// Sets a key of `[DeviceComissioning]`.
    pub fn set_commissioning(&mut self, key: &str, value: &str) {
        self.set(Title::Named(Heading::Commissioning), key, value);
    }

    /// Sets the value of an object wherever the file describes it. An object described by `CompactPDO` alone gets
    /// sections first, from `all`.
    pub fn set_value(&mut self, object: Object, value: &str, all: &[EdsObject]) {
        let Object { index, sub } = object;
        let is_compact = self.get(Title::Object(index), "CompactSubObj").is_some();
        let has = |title| self.find(title).is_some();
        let home = if has(Title::Sub(index, sub)) {
            Title::Sub(index, sub)
        } else if is_compact {
            Title::Values(index)
        } else if has(Title::Object(index)) {
            Title::Object(index)
        } else {
            self.expand_compact_pdo(index, all);
            Title::Sub(index, sub)
        };
        if home != Title::Values(index) {
            self.set(home, "ParameterValue", value);
            return;
        }
        self.set(home, &sub.to_string(), value);
        let is_value = |(key, _): &&(Cow<'_, str>, Cow<'_, str>)| key.parse::<u8>().is_ok();
        let count = self.find(home).map_or(0, |part| part.entries.iter().filter(is_value).count());
        self.set(home, "NrOfEntries", &count.to_string());
    }

    /// Removes the limits of an object, which exclude a value that the device takes.
    pub fn drop_limits(&mut self, object: Object) {
        let Object { index, sub } = object;
        let own = if sub == 0 { Title::Object(index) } else { Title::Sub(index, sub) };
        for part in &mut self.sections {
            if [own, Title::Sub(index, sub)].contains(&Title::parse(&part.name)) {
                let is_limit = |key: &str| {
                    key.eq_ignore_ascii_case("LowLimit") || key.eq_ignore_ascii_case("HighLimit")
                };
                part.entries.retain(|(key, _)| !is_limit(key));
            }
        }
    }

    /// Adds sections for both parameters of the PDO that `CompactPDO` describes at `index`.
    fn expand_compact_pdo(&mut self, index: u16, all: &[EdsObject]) {
        let communication = index & !0x0200;
        for index in [communication, communication | 0x0200] {
            let objects = all.iter().filter(|described| described.object.index == index);
            if objects.clone().next().is_none() || self.find(Title::Object(index)).is_some() {
                continue;
            }
            self.list(index);
            let head = Title::Object(index);
            self.set(head, "SubNumber", &objects.clone().count().to_string());
            self.set(head, "ParameterName", "PDO parameter");
            self.set(head, "ObjectType", "0x9");
            objects.for_each(|described| self.describe(described));
        }
    }

    /// Adds an object to its list.
    fn list(&mut self, index: u16) {
        let list = Title::Named(Heading::list_of(index));
        let listed = self.get(list, "SupportedObjects").and_then(|count| count.parse().ok());
        let count = listed.unwrap_or(0_u16).saturating_add(1).to_string();
        self.set(list, &count, &format!("0x{index:04X}"));
        self.set(list, "SupportedObjects", &count);
    }

    /// Adds a section for an object without one.
    fn describe(&mut self, described: &EdsObject) {
        let Object { index, sub } = described.object;
        let section = Title::Sub(index, sub);
        self.set(section, "ParameterName", &described.name);
        self.set(section, "ObjectType", "0x7");
        self.set(section, "DataType", &format!("0x{:04X}", described.data_type));
        self.set(section, "AccessType", described.access.word());
        self.set(section, "DefaultValue", &described.default);
        self.set(section, "PDOMapping", "0");
    }

    fn find(&self, title: Title<'_>) -> Option<&Part<'t>> {
        self.sections.iter().find(|part| Title::parse(&part.name) == title)
    }

    fn get(&self, title: Title<'_>, key: &str) -> Option<&str> {
        let entries = &self.find(title)?.entries;
        let found = entries.iter().find(|(name, _)| name.eq_ignore_ascii_case(key));
        found.map(|(_, value)| value.as_ref())
    }

    /// Sets a key, in a new section if needed. Control characters become blanks.
    fn set(&mut self, title: Title<'_>, key: &str, value: &str) {
        let value = value.replace(char::is_control, " ").trim().to_owned();
        let place = self.sections.iter().position(|part| Title::parse(&part.name) == title);
        let place = place.unwrap_or_else(|| {
            self.sections.push(Part { name: title.to_string(), entries: Vec::new() });
            self.sections.len() - 1
        });
        let Some(part) = self.sections.get_mut(place) else { return };
        match part.entries.iter_mut().find(|(name, _)| name.eq_ignore_ascii_case(key)) {
            Some((_, old)) => *old = value.into(),
            None => part.entries.push((key.to_owned().into(), value.into())),
        }
    }

    /// Writes the file: ASCII, or Latin-1 where names require it.
    pub fn write(&self) -> Vec<u8> {
        let mut parts: Vec<_> = self.sections.iter().collect();
        parts.sort_by_cached_key(|part| order(Title::parse(&part.name)));
        let mut text = String::new();
        for (place, part) in parts.into_iter().enumerate() {
            text.push_str(if place == 0 { "[" } else { "\r\n[" });
            text.push_str(&part.name);
            text.push_str("]\r\n");
            let title = Title::parse(&part.name);
            let mut entries: Vec<_> = part.entries.iter().collect();
            entries.sort_by_key(|(key, _)| keys::place(title, key).unwrap_or(usize::MAX));
            for (key, value) in entries {
                text.push_str(key);
                text.push('=');
                text.push_str(value);
                text.push_str("\r\n");
            }
        }
        eds::encode(text)
    }
}

fn part<'t>(section: &Section<'t>) -> Part<'t> {
    let mut seen = HashSet::with_capacity(section.entries.len());
    let first = section.entries.iter().filter(|entry| seen.insert(entry.folded()));
    let entries = first.map(|entry| {
        let key = keys::canonical(section.title, entry.key).unwrap_or(entry.key);
        (key.into(), entry.value.into())
    });
    Part { name: section.title.to_string(), entries: entries.collect() }
}

/// Order of a section: objects after their list, sub-indices after their object.
fn order(title: Title<'_>) -> (Heading, u8, u16, u8, u8) {
    let of_object = |index, part, sub| (Heading::list_of(index), 1, index, part, sub);
    match title {
        Title::Named(named) => (named, 0, 0, 0, 0),
        Title::Object(index) => of_object(index, 0, 0),
        Title::Sub(index, sub) => of_object(index, 1, sub),
        Title::Names(index) => of_object(index, 2, 0),
        Title::Values(index) => of_object(index, 3, 0),
        Title::Denotations(index) => of_object(index, 4, 0),
        Title::Links(index) => of_object(index, 5, 0),
        Title::Other(_) => (Heading::Manufacturer, 2, 0, 0, 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_sections_are_in_order() {
        let text = "[Tools]\nx=1\n[2000SUB1]\nDataType=7\nparametername=B\n[2000]\nObjectType=9\n\
            SubNumber=1\nParameterName=A\n[DeviceCommissioning]\nNodeID=3\n[1000]\nDataType=7\n\
            [1000]\nDataType=8\n";
        let written = Sheet::from_eds(&Eds::parse(text.as_bytes()).unwrap()).write();
        assert_eq!(
            String::from_utf8(written).unwrap().replace("\r\n", "\n"),
            "[DeviceComissioning]\nNodeID=3\n\n[1000]\nDataType=7\n\n[2000]\nSubNumber=1\n\
             ParameterName=A\nObjectType=9\n\n[2000sub1]\nParameterName=B\nDataType=7\n\n\
             [Tools]\nx=1\n"
        );
    }
}
