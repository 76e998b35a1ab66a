//! Findings in an EDS by line: everything that makes it misleading, or that tools read differently.
//!
//! An error misleads a reader of the file; a warning is unusual, or read differently elsewhere.

mod device;
mod file;
mod lists;
mod mapping;
mod objects;

use std::fmt;

use derive_more::Display;
use serde::Serialize;

use crate::eds::Eds;
use crate::eds::ini::{Entry, Ini, Section};
use crate::eds::title::Title;
use crate::object::Object;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Misleading.
    #[display("error")]
    Error,
    /// Unusual.
    #[display("warning")]
    Warning,
}

/// Finding in an EDS.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Line, from 1; absent parts are reported at line 1.
    pub line: usize,
    /// Error if the file misleads, else a warning.
    pub severity: Severity,
    /// Object, as in `1018h:1`, or section in brackets; empty for a finding about the file.
    pub place: String,
    /// Key; empty for a finding about the section.
    pub key: String,
    /// Defect in words.
    pub reason: String,
    /// Set if a part is missing that the file announces: a miscount of its maker, or a truncated file.
    #[serde(skip)]
    pub gap: Option<Gap>,
}

/// Missing part of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gap {
    /// Fewer objects are listed than counted.
    Count,
    /// No section, or fewer sub-indices than counted, for the object of this index.
    Object(u16),
}

/// `12: error: 1018h:1 DefaultValue: not a number`
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}: ", self.line, self.severity)?;
        match (self.place.is_empty(), self.key.is_empty()) {
            (true, _) => {}
            (false, true) => write!(f, "{}: ", self.place)?,
            (false, false) => write!(f, "{} {}: ", self.place, self.key)?,
        }
        f.write_str(&self.reason)
    }
}

/// Maximum findings per severity.
const MAX_FINDINGS: usize = 1_000;

/// Findings in a file, by line.
pub(super) fn lint(eds: &Eds) -> Vec<Finding> {
    let ini = Ini::read(&eds.text.text);
    let mut lint = Lint { eds, ini: &ini, errors: Vec::new(), warnings: Vec::new() };
    file::check(&mut lint);
    device::check(&mut lint);
    lists::check(&mut lint);
    objects::check(&mut lint);
    mapping::check(&mut lint);
    let mut found = lint.errors;
    found.append(&mut lint.warnings);
    found.sort_by_key(|finding| finding.line);
    found
}

/// Numbers of `[DeviceInfo]` that differ from the defaults of the identity object.
pub(super) fn identity_conflicts(eds: &Eds) -> Vec<Finding> {
    let ini = Ini::read(&eds.text.text);
    let mut lint = Lint { eds, ini: &ini, errors: Vec::new(), warnings: Vec::new() };
    device::identity_conflicts(&mut lint);
    lint.warnings
}

/// First sign that the file ends inside a section: an error in its last one, or its last object is not complete and a listed
/// one has no section. If that object alone is not complete, its maker has miscounted its sub-indices.
pub(super) fn truncation(eds: &Eds) -> Option<Finding> {
    let ini = Ini::read(&eds.text.text);
    let last = ini.sections().last()?;
    let last_object = match last.title {
        Title::Object(index) | Title::Sub(index, _) => Some(index),
        Title::Named(_)
        | Title::Names(_)
        | Title::Values(_)
        | Title::Denotations(_)
        | Title::Links(_)
        | Title::Other(_) => None,
    };
    let findings = lint(eds);
    let is_lost = |finding: &Finding| match finding.gap {
        Some(Gap::Object(index)) => ini.section(Title::Object(index)).is_none(),
        Some(Gap::Count) | None => false,
    };
    let is_cut = findings.iter().any(is_lost);
    let is_sign = |finding: &Finding| {
        let is_at_end = finding.severity == Severity::Error && finding.line >= last.line;
        is_at_end || is_cut && last_object.is_some() && finding.gap == last_object.map(Gap::Object)
    };
    findings.iter().find(|finding| is_sign(finding)).cloned()
}

/// Check in progress.
struct Lint<'e> {
    eds: &'e Eds,
    ini: &'e Ini<'e>,
    errors: Vec<Finding>,
    warnings: Vec<Finding>,
}

/// Place of a finding.
#[derive(Clone, Copy)]
struct Spot<'t> {
    line: usize,
    title: Option<Title<'t>>,
    key: &'t str,
}

impl<'t> Spot<'t> {
    /// Line outside any section.
    const fn line(line: usize) -> Self {
        Self { line, title: None, key: "" }
    }

    /// Missing section.
    const fn missing(title: Title<'t>) -> Self {
        Self { line: 1, title: Some(title), key: "" }
    }

    /// Section without a key.
    const fn section(section: &Section<'t>) -> Self {
        Self { line: section.line, title: Some(section.title), key: "" }
    }

    /// Key with its value.
    const fn entry(section: &Section<'t>, entry: &Entry<'t>) -> Self {
        Self { line: entry.line, title: Some(section.title), key: entry.key }
    }

    /// Entry of a key, present or not.
    fn key(section: &Section<'t>, key: &'t str) -> Self {
        let line = section.entry(key).map_or(section.line, |entry| entry.line);
        Self { line, title: Some(section.title), key }
    }
}

impl<'e> Lint<'e> {
    fn error(&mut self, spot: Spot<'_>, reason: impl fmt::Display) {
        add(&mut self.errors, Severity::Error, spot, reason);
    }

    /// Adds an error for a missing part that the file announces.
    fn gap(&mut self, spot: Spot<'_>, gap: Gap, reason: impl fmt::Display) {
        let before = self.errors.len();
        self.error(spot, reason);
        self.errors.iter_mut().skip(before).for_each(|finding| finding.gap = Some(gap));
    }

    fn warning(&mut self, spot: Spot<'_>, reason: impl fmt::Display) {
        add(&mut self.warnings, Severity::Warning, spot, reason);
    }

    /// Entry of an object, in the section that describes the object.
    fn spot(&self, object: Object, key: &'e str) -> Spot<'e> {
        let Object { index, sub } = object;
        let own = Title::Sub(index, sub);
        let section = self.ini.section(own).or_else(|| self.ini.section(Title::Object(index)));
        section.map_or(Spot::missing(own), |section| Spot::key(section, key))
    }
}

fn add(found: &mut Vec<Finding>, severity: Severity, spot: Spot<'_>, reason: impl fmt::Display) {
    if found.len() < MAX_FINDINGS {
        let place = spot.title.map(place).unwrap_or_default();
        let (line, key, reason) = (spot.line, spot.key.to_owned(), reason.to_string());
        found.push(Finding { line, severity, place, key, reason, gap: None });
    }
}

/// Text of a section's subject.
fn place(title: Title<'_>) -> String {
    match title {
        Title::Object(index) => Object { index, sub: 0 }.to_string(),
        Title::Sub(index, sub) => format!("{index:04X}h:{sub}"),
        Title::Named(_)
        | Title::Names(_)
        | Title::Values(_)
        | Title::Denotations(_)
        | Title::Links(_)
        | Title::Other(_) => format!("[{title}]"),
    }
}
