//! What is wrong with a configuration, where, and why: one line each, all of them in one run.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;
use std::path::PathBuf;

use crate::trust::Trust;
use canopen::eds::Eds;

/// One thing wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The file it is in.
    pub file: PathBuf,
    /// The line of the key, where there is one.
    pub line: Option<usize>,
    /// The key, like `joint[2].torque_curve`; empty for the file as a whole.
    pub key: String,
    /// What is wrong with its value.
    pub reason: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.reason)
    }
}

/// A configuration that cannot be used, with everything that is wrong with it; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Invalid(pub Vec<Problem>);

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, problem) in self.0.iter().enumerate() {
            if place > 0 {
                writeln!(f)?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Invalid {}

/// Collects the problems of one file.
#[derive(Debug)]
pub(super) struct Problems<'t> {
    file: PathBuf,
    text: &'t str,
    trust: Trust,
    found: Vec<Problem>,
    sheets: Sheets,
}

/// Data sheets that were read, each with the first sign that it is not whole.
pub(super) type Sheets = HashMap<PathBuf, (Eds, Option<String>)>;

impl<'t> Problems<'t> {
    /// None yet, in `file` that reads `text`.
    pub(super) fn new(file: &Path, text: &'t str, trust: Trust) -> Self {
        Self { file: file.to_path_buf(), text, trust, found: Vec::new(), sheets: Sheets::new() }
    }

    /// Data sheets read so far: joints share them.
    pub(super) const fn sheets(&mut self) -> &mut Sheets {
        &mut self.sheets
    }

    /// What the files it names must be worth.
    pub(super) const fn trust(&self) -> Trust {
        self.trust
    }

    /// The value of `key` is wrong.
    pub(super) fn add(&mut self, key: &str, reason: impl fmt::Display) {
        let line = line_of(self.text, key);
        self.found.push(Problem {
            file: self.file.clone(),
            line,
            key: key.to_owned(),
            reason: reason.to_string(),
        });
    }

    /// The text is wrong at a byte offset, in the value of a key or anywhere else.
    pub(super) fn add_at(&mut self, offset: Option<usize>, reason: impl fmt::Display) {
        let line = offset.map(|offset| 1 + newlines(self.text, offset));
        let reason = reason.to_string();
        // What is missing has no place of its own.
        let place = offset.filter(|_| !reason.starts_with("missing field"));
        let key = place.map(|offset| written::key_at(self.text, offset)).unwrap_or_default();
        self.found.push(Problem { file: self.file.clone(), line, key, reason });
    }

    /// The value, or the problem noted under `key`.
    pub(super) fn take<T, E: fmt::Display>(
        &mut self,
        key: &str,
        result: Result<T, E>,
    ) -> Option<T> {
        result.map_err(|error| self.add(key, error)).ok()
    }

    /// How many were found so far.
    pub(super) const fn count(&self) -> usize {
        self.found.len()
    }

    /// Like [`take`](Self::take), but silent where one of the numbers it is made of has been noted
    /// already, since there were `before`.
    pub(super) fn take_unless_noted<T, E: fmt::Display>(
        &mut self,
        before: usize,
        key: &str,
        result: Result<T, E>,
    ) -> Option<T> {
        if self.count() > before { result.ok() } else { self.take(key, result) }
    }

    /// Returns whether a key that begins like this is noted already: its consequences need no line of their own.
    pub(super) fn is_noted(&self, beginning: &str) -> bool {
        self.found.iter().any(|problem| problem.key.starts_with(beginning))
    }

    /// `value` of `key` must be a finite number.
    pub(super) fn finite(&mut self, key: &str, value: f64) -> f64 {
        if !value.is_finite() {
            self.add(key, format_args!("{value} is not a finite number"));
        }
        value
    }

    /// `value` of `key` must be finite and above zero.
    pub(super) fn positive(&mut self, key: &str, value: f64) -> f64 {
        if !(value.is_finite() && value > 0.0) {
            self.add(key, format_args!("{value} is not above zero"));
        }
        value
    }

    /// `value` of `key` must be finite and not below zero.
    pub(super) fn not_negative(&mut self, key: &str, value: f64) -> f64 {
        if !(value.is_finite() && value >= 0.0) {
            self.add(key, format_args!("{value} is not zero or above"));
        }
        value
    }

    /// Every number of the list must be finite.
    pub(super) fn all_finite<const N: usize>(&mut self, key: &str, values: [f64; N]) -> [f64; N] {
        if let Some(wrong) = values.iter().find(|value| !value.is_finite()) {
            self.add(key, format_args!("{wrong} is not a finite number"));
        }
        values
    }

    /// Every number of the list must be finite and not below zero.
    pub(super) fn none_negative<const N: usize>(
        &mut self,
        key: &str,
        values: [f64; N],
    ) -> [f64; N] {
        if let Some(wrong) = values.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            self.add(key, format_args!("{wrong} is not zero or above"));
        }
        values
    }

    /// `value` of `key` must be one of the names of `choices`.
    pub(super) fn one_of<T: Copy>(
        &mut self,
        key: &str,
        value: &str,
        choices: &[(&str, T)],
    ) -> Option<T> {
        let found = choices.iter().find(|(name, _)| *name == value).map(|(_, choice)| *choice);
        if found.is_none() {
            let names: Vec<String> =
                choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
            self.add(key, format_args!("\"{value}\": there is {}", names.join(", ")));
        }
        found
    }

    /// `value` of `key` must lie in `range`.
    pub(super) fn within<T: PartialOrd + fmt::Display>(
        &mut self,
        key: &str,
        value: T,
        range: std::ops::RangeInclusive<T>,
    ) -> T {
        if !range.contains(&value) {
            let (least, most) = (range.start(), range.end());
            self.add(key, format_args!("{value} is not within {least} and {most}"));
        }
        value
    }

    /// The problems, if there are any.
    pub(super) fn finish(self) -> Result<(), Invalid> {
        if self.found.is_empty() { Ok(()) } else { Err(Invalid(self.found)) }
    }
}

/// The line `key` stands on: of its value, or of the nearest table around it that is written down.
fn line_of(text: &str, key: &str) -> Option<usize> {
    let document = toml::de::DeTable::parse(text).ok()?;
    let mut offset = None;
    let mut table = Some(document.get_ref());
    let mut array: Option<&toml::de::DeArray<'_>> = None;
    for part in key.split(['.', '[']) {
        let value = if let Some(place) = part.strip_suffix(']') {
            array.take().zip(place.parse::<usize>().ok()).and_then(|(list, place)| list.get(place))
        } else {
            table.take().and_then(|table| table.get(part))
        };
        let Some(value) = value else { break };
        offset = Some(value.span().start);
        match value.get_ref() {
            toml::de::DeValue::Table(inner) => table = Some(inner),
            toml::de::DeValue::Array(inner) => array = Some(inner),
            toml::de::DeValue::String(_)
            | toml::de::DeValue::Integer(_)
            | toml::de::DeValue::Float(_)
            | toml::de::DeValue::Boolean(_)
            | toml::de::DeValue::Datetime(_) => {}
        }
    }
    offset.map(|offset| 1 + newlines(text, offset))
}

fn newlines(text: &str, before: usize) -> usize {
    text.bytes().take(before).filter(|byte| *byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[node]\na = 1\n\n[[joint]]\nb = 2\n\n[[joint]]\nb = 3\nc = [\n 1,\n 2]\n";

    #[test]
    fn a_key_is_found_on_its_line() {
        assert_eq!(line_of(TEXT, "node.a"), Some(2));
        assert_eq!(line_of(TEXT, "joint[0].b"), Some(5));
        assert_eq!(line_of(TEXT, "joint[1].c"), Some(9));
    }

    #[test]
    fn a_missing_key_is_missed_in_its_table() {
        assert_eq!(line_of(TEXT, "joint[1].d"), Some(7));
        assert_eq!(line_of(TEXT, "remote"), None);
    }
}
