//! Lines of an EDS (CiA 306, 4.1): sections of `key=value`, as in real files.
//!
//! Blanks are ignored, names are case-insensitive, `;` starts a comment. A value is everything after the first
//! `=`; where only one word is valid, a `;` ends it ([`Entry::word`]). Of two sections or keys with one name the
//! first counts, as in the Windows functions for this format.

use std::borrow::Cow;
use std::collections::{HashMap, hash_map};

use crate::eds::title::Title;

/// Parsed sections of a text.
#[derive(Debug, Default)]
pub struct Ini<'t> {
    sections: Vec<Section<'t>>,
    /// Index of the first section of each title.
    places: HashMap<Title<'t>, usize>,
    strays: Vec<Stray>,
}

/// One `[section]` and its entries.
#[derive(Debug)]
pub struct Section<'t> {
    /// Text in the brackets.
    pub name: &'t str,
    /// Parsed title.
    pub title: Title<'t>,
    /// First line, from 1.
    pub line: usize,
    /// Set if no earlier section has this title.
    pub is_first: bool,
    /// Entries, in order.
    pub entries: Vec<Entry<'t>>,
}

/// One line `key=value`.
#[derive(Clone, Copy, Debug)]
pub struct Entry<'t> {
    /// Text before the `=`.
    pub key: &'t str,
    /// Text after the `=`.
    pub value: &'t str,
    /// Line, from 1.
    pub line: usize,
}

/// Invalid line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stray {
    /// Line, from 1.
    pub line: usize,
    /// Reason.
    pub oddity: Oddity,
}

/// Reason why a line is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oddity {
    /// Not a section, an entry or a comment; skipped.
    NoEntry,
    /// Entry before the first section; skipped.
    Homeless,
    /// Comment behind `#`.
    Hash,
    /// Section without `]`.
    Unclosed,
    /// Text after `]` that is not a comment; skipped.
    BehindSection,
}

impl<'t> Ini<'t> {
    /// Parses a text whose lines end with `\n`. Any text is accepted.
    pub fn read(text: &'t str) -> Self {
        let mut ini = Self::default();
        for (line, text) in (1..).zip(text.split('\n')) {
            let text = trim(text);
            if text.is_empty() || text.starts_with(';') {
                continue;
            }
            let oddity = if let Some(rest) = text.strip_prefix('[') {
                ini.open(rest, line)
            } else if text.starts_with('#') {
                Some(Oddity::Hash)
            } else if let Some((key, value)) = text.split_once('=') {
                let entry = Entry { key: trim(key), value: trim(value), line };
                let home = ini.sections.last_mut().map(|section| section.entries.push(entry));
                home.is_none().then_some(Oddity::Homeless)
            } else {
                Some(Oddity::NoEntry)
            };
            ini.strays.extend(oddity.map(|oddity| Stray { line, oddity }));
        }
        ini
    }

    /// Opens the section whose `[` was removed.
    fn open(&mut self, text: &'t str, line: usize) -> Option<Oddity> {
        let (name, behind) = text.split_once(']').map_or((text, None), |(a, b)| (a, Some(b)));
        let name = trim(name);
        let title = Title::parse(name);
        let is_first = match self.places.entry(title) {
            hash_map::Entry::Occupied(_) => false,
            hash_map::Entry::Vacant(place) => {
                place.insert(self.sections.len());
                true
            }
        };
        self.sections.push(Section { name, title, line, is_first, entries: Vec::new() });
        match behind.map(trim) {
            None => Some(Oddity::Unclosed),
            Some(rest) if rest.is_empty() || rest.starts_with([';', '#']) => None,
            Some(_) => Some(Oddity::BehindSection),
        }
    }

    /// Sections, in order.
    pub fn sections(&self) -> &[Section<'t>] {
        &self.sections
    }

    /// First sections of each title, in order.
    pub fn first_sections(&self) -> impl Iterator<Item = &Section<'t>> {
        self.sections.iter().filter(|section| section.is_first)
    }

    /// Returns the first section of a title.
    pub fn section<'s>(&'s self, title: Title<'s>) -> Option<&'s Section<'t>> {
        let places: &HashMap<Title<'s>, usize> = &self.places;
        self.sections.get(*places.get(&title)?)
    }

    /// Invalid lines.
    pub fn strays(&self) -> &[Stray] {
        &self.strays
    }
}

impl<'t> Section<'t> {
    /// Returns the first entry of a key.
    pub fn entry(&self, key: &str) -> Option<&Entry<'t>> {
        self.entries.iter().find(|entry| entry.key.eq_ignore_ascii_case(key))
    }

    /// Returns the first entry of a key, unless it is empty.
    pub fn value(&self, key: &str) -> Option<&Entry<'t>> {
        self.entry(key).filter(|entry| !entry.word().is_empty())
    }

    /// Total size of all values, in bytes.
    pub fn bytes(&self) -> usize {
        self.entries.iter().map(|entry| entry.value.len()).sum()
    }

    /// Returns the text of a key; empty if absent.
    pub fn text(&self, key: &str) -> &'t str {
        self.entry(key).map_or("", |entry| entry.value)
    }
}

impl<'t> Entry<'t> {
    /// Key in lower case, for comparisons.
    pub fn folded(&self) -> Cow<'t, str> {
        if self.key.bytes().any(|byte| byte.is_ascii_uppercase()) {
            Cow::Owned(self.key.to_ascii_lowercase())
        } else {
            Cow::Borrowed(self.key)
        }
    }

    /// Value without its comment: for everything but names and texts.
    pub fn word(&self) -> &'t str {
        self.value.split_once(';').map_or(self.value, |(word, _)| trim(word))
    }
}

/// Removes blanks, NULs, and the end-of-file mark of DOS.
fn trim(text: &str) -> &str {
    text.trim_matches(|c: char| c.is_whitespace() || c.is_control() || c == '\u{FEFF}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_keeps_quotes_and_hashes() {
        let ini = Ini::read("[FileInfo]\nA=C:\\new;1 #3\nB = 0x10 ; a comment\nC==\nD=\n");
        let section = &ini.sections()[0];
        assert_eq!(section.text("a"), "C:\\new;1 #3");
        assert_eq!(section.entry("b").unwrap().word(), "0x10");
        assert_eq!(section.text("C"), "=");
        assert!(section.value("D").is_none() && section.entry("D").is_some());
    }

    #[test]
    fn first_of_two_entries_counts() {
        let ini = Ini::read("[1000]\nA=1\na=2\n[ 1000 ]\nA=3\n[1000SUB0]\n");
        assert_eq!(ini.section(Title::Object(0x1000)).unwrap().text("A"), "1");
        assert_eq!(
            ini.sections().iter().map(|one| one.is_first).collect::<Vec<_>>(),
            [true, false, true]
        );
    }

    #[test]
    fn invalid_lines_are_recorded_and_skipped() {
        let ini = Ini::read("a=1\n[1000\nword\n# note\n[1001] x\n[1002] ; y\n\0\u{1A}");
        let found: Vec<_> = ini.strays().iter().map(|stray| (stray.line, stray.oddity)).collect();
        assert_eq!(
            found,
            [
                (1, Oddity::Homeless),
                (2, Oddity::Unclosed),
                (3, Oddity::NoEntry),
                (4, Oddity::Hash),
                (5, Oddity::BehindSection),
            ]
        );
        assert_eq!(ini.sections().len(), 3);
    }
}
