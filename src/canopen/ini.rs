//! The text of an EDS (CiA 306): sections of `key=value` lines, as real files have them.
//!
//! Latin-1 where it is no UTF-8, a byte order mark, any line ends, `;` comments, blanks anywhere, names
//! in any case. A value is everything behind the first `=`, quotes and `#` included.

use std::collections::HashMap;

/// The most bytes a file may have.
pub(super) const LARGEST: usize = 4 << 20;

/// A file in sections.
#[derive(Debug, Default)]
pub(super) struct Ini {
    sections: Vec<Section>,
    /// Where the first section of each name is.
    places: HashMap<String, usize>,
}

/// One section.
#[derive(Debug)]
pub(super) struct Section {
    /// What stands in the brackets, in upper case.
    pub(super) name: String,
    /// The line it begins on, from 1.
    pub(super) line: usize,
    entries: Vec<Entry>,
}

/// One line of a section.
#[derive(Debug)]
pub(super) struct Entry {
    /// What stands before the `=`, in upper case.
    pub(super) key: String,
    /// What stands behind it.
    pub(super) value: String,
    /// Its line, from 1.
    pub(super) line: usize,
}

impl Ini {
    /// Reads a text; the number of a line that is neither a section, an entry nor a comment.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, usize> {
        let text = decode(bytes);
        let mut ini = Self::default();
        for (line, text) in (1..).zip(text.trim_start_matches('\u{FEFF}').lines()) {
            let text = text.trim();
            if text.is_empty() || text.starts_with(';') {
                continue;
            }
            if let Some(name) = text.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
                let name = name.trim().to_ascii_uppercase();
                ini.places.entry(name.clone()).or_insert(ini.sections.len());
                ini.sections.push(Section { name, line, entries: Vec::new() });
                continue;
            }
            let (key, value) = text.split_once('=').ok_or(line)?;
            let section = ini.sections.last_mut().ok_or(line)?;
            let key = key.trim().to_ascii_uppercase();
            section.entries.push(Entry { key, value: value.trim().to_owned(), line });
        }
        Ok(ini)
    }

    /// All sections, in their order.
    pub(super) fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// The first section of that name, in upper case.
    pub(super) fn section(&self, name: &str) -> Option<&Section> {
        self.sections.get(*self.places.get(name)?)
    }
}

impl Section {
    /// The entry of that name, in upper case.
    pub(super) fn entry(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// Its value, if there is one and it is not empty.
    pub(super) fn value(&self, key: &str) -> Option<&Entry> {
        self.entry(key).filter(|entry| !entry.value.is_empty())
    }
}

/// UTF-8, or else Latin-1, which every byte is.
fn decode(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().copied().map(char::from).collect(),
    }
}
