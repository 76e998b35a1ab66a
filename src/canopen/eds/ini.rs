//! The lines of an EDS (CiA 306, 4.1): sections of `key=value`, as real files have them.
//!
//! Knows no object dictionary. Blanks anywhere, names in any case, `;` before a comment. A value is
//! everything behind the first `=`, quotes and `#` included; where only one word can stand, a `;` ends
//! it ([`Entry::word`]). Of two sections or keys of the same name the first counts, as it does for the
//! functions of Windows this format was made for.

use std::borrow::Cow;
use std::collections::HashMap;
use std::collections::hash_map;

use crate::eds::title::Title;

/// A text in sections.
#[derive(Debug, Default)]
pub(super) struct Ini<'t> {
    sections: Vec<Section<'t>>,
    /// Where the first section of each title is.
    places: HashMap<Title<'t>, usize>,
    strays: Vec<Stray>,
}

/// One section.
#[derive(Debug)]
pub(super) struct Section<'t> {
    /// What stands in the brackets.
    pub(super) name: &'t str,
    /// What that says.
    pub(super) title: Title<'t>,
    /// The line it begins on, from 1.
    pub(super) line: usize,
    /// Whether no section before it has this title.
    pub(super) is_first: bool,
    /// Its lines.
    pub(super) entries: Vec<Entry<'t>>,
}

/// One line of a section.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry<'t> {
    /// What stands before the `=`.
    pub(super) key: &'t str,
    /// What stands behind it.
    pub(super) value: &'t str,
    /// Its line, from 1.
    pub(super) line: usize,
}

/// A line that is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stray {
    /// Its line, from 1.
    pub(super) line: usize,
    /// What is wrong with it.
    pub(super) oddity: Oddity,
}

/// What is wrong with a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Oddity {
    /// Neither a section, an entry nor a comment; skipped.
    NoEntry,
    /// An entry before the first section; skipped.
    Homeless,
    /// A comment behind `#`.
    Hash,
    /// A section without `]`.
    Unclosed,
    /// Something behind `]` that is no comment; skipped.
    BehindSection,
}

impl<'t> Ini<'t> {
    /// Reads a text whose lines end with `\n`. Any text is one.
    pub(super) fn read(text: &'t str) -> Self {
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

    /// Begins the section whose `[` was taken off.
    fn open(&mut self, text: &'t str, line: usize) -> Option<Oddity> {
        let (name, behind) = text.split_once(']').map_or((text, None), |(a, b)| (a, Some(b)));
        let name = trim(name);
        let title = Title::of(name);
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

    /// All sections, in their order.
    pub(super) fn sections(&self) -> &[Section<'t>] {
        &self.sections
    }

    /// The first section of each title, in their order.
    pub(super) fn first_sections(&self) -> impl Iterator<Item = &Section<'t>> {
        self.sections.iter().filter(|section| section.is_first)
    }

    /// The first section of that title.
    pub(super) fn section<'s>(&'s self, title: Title<'s>) -> Option<&'s Section<'t>> {
        let places: &HashMap<Title<'s>, usize> = &self.places;
        self.sections.get(*places.get(&title)?)
    }

    /// Every line that is not as it should be.
    pub(super) fn strays(&self) -> &[Stray] {
        &self.strays
    }
}

impl<'t> Section<'t> {
    /// The first entry of that name.
    pub(super) fn entry(&self, key: &str) -> Option<&Entry<'t>> {
        self.entries.iter().find(|entry| entry.key.eq_ignore_ascii_case(key))
    }

    /// The same, if it is not empty.
    pub(super) fn value(&self, key: &str) -> Option<&Entry<'t>> {
        self.entry(key).filter(|entry| !entry.word().is_empty())
    }

    /// The bytes of all its values.
    pub(super) fn bytes(&self) -> usize {
        self.entries.iter().map(|entry| entry.value.len()).sum()
    }

    /// Its text; empty if there is none.
    pub(super) fn text(&self, key: &str) -> &'t str {
        self.entry(key).map_or("", |entry| entry.value)
    }
}

impl<'t> Entry<'t> {
    /// The key for comparisons, in lower case.
    pub(super) fn folded(&self) -> Cow<'t, str> {
        if self.key.bytes().any(|byte| byte.is_ascii_uppercase()) {
            Cow::Owned(self.key.to_ascii_lowercase())
        } else {
            Cow::Borrowed(self.key)
        }
    }

    /// The value without a comment behind it: for everything but names and texts.
    pub(super) fn word(&self) -> &'t str {
        self.value.split_once(';').map_or(self.value, |(word, _)| trim(word))
    }
}

/// Without the blanks, and the NULs and the end-of-file mark of DOS, at its ends.
fn trim(text: &str) -> &str {
    text.trim_matches(|c: char| c.is_whitespace() || c.is_control() || c == '\u{FEFF}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_keeps_what_may_belong_to_it() {
        let ini = Ini::read("[FileInfo]\nA=C:\\new;1 #3\nB = 0x10 ; a comment\nC==\nD=\n");
        let section = &ini.sections()[0];
        assert_eq!(section.text("a"), "C:\\new;1 #3");
        assert_eq!(section.entry("b").unwrap().word(), "0x10");
        assert_eq!(section.text("C"), "=");
        assert!(section.value("D").is_none() && section.entry("D").is_some());
    }

    #[test]
    fn the_first_of_two_counts() {
        let ini = Ini::read("[1000]\nA=1\na=2\n[ 1000 ]\nA=3\n[1000SUB0]\n");
        assert_eq!(ini.section(Title::Object(0x1000)).unwrap().text("A"), "1");
        assert_eq!(
            ini.sections().iter().map(|one| one.is_first).collect::<Vec<_>>(),
            [true, false, true]
        );
    }

    #[test]
    fn odd_lines_are_remembered_and_passed_over() {
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
