//! Problems of a configuration file, with place and reason. One run collects all of them.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::encoding;
use crate::file_kind::{self, FileKind};
use crate::files::Files;
use crate::value::{HasPlace, Place, Value};
use canopen::eds::{Eds, Finding};
use toml::Spanned;
use toml::de::DeTable;
use toml_input::List;
use units::wording::{grouped, listed};

/// One problem: file, line, key and reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Path of the file that has the problem.
    pub file: PathBuf,
    /// Line of the key, if known.
    pub line: Option<usize>,
    /// Key, as in `joint[2].torque_curve`; empty for a problem without a key.
    pub key: String,
    /// Violated constraint, and the value.
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

/// Problems of a refused configuration, at least one.
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

/// Returns the text of a file.
///
/// # Errors
/// When the file cannot be read, or is not UTF-8.
pub fn text(files: &Files, file: &Path) -> Result<String, Invalid> {
    let alone = |line, reason: String| {
        let file = file.to_path_buf();
        Invalid(vec![Problem { file, line, key: String::new(), reason }])
    };
    let content = files.read(file).map_err(|error| alone(None, error.to_string()))?;
    let text = encoding::decode(&content);
    text.map(str::to_owned).map_err(|wrong| alone(Some(wrong.line), wrong.to_string()))
}

/// Collects the problems of one file.
#[derive(Debug)]
pub struct Problems<'t> {
    file: PathBuf,
    text: &'t str,
    /// Byte offsets of line ends.
    ends: Vec<usize>,
    files: Files,
    found: Vec<Problem>,
    /// Problems of nodes with the names of the nodes. Equal problems of several joints are merged.
    of_nodes: Vec<(String, Problem)>,
    sheets: Sheets,
}

/// EDS files that were read, or why they cannot be used.
pub type Sheets = BTreeMap<PathBuf, Result<Sheet, String>>;

/// EDS file with the number of its errors, and its gaps.
#[derive(Clone, Debug)]
pub struct Sheet {
    pub eds: Arc<Eds>,
    pub errors: usize,
    pub gaps: Vec<Finding>,
}

impl<'t> Problems<'t> {
    /// Returns an empty collection for `file` with the content `text`.
    pub fn new(file: &Path, text: &'t str, files: &Files) -> Self {
        let ends = text.match_indices('\n').map(|(end, _)| end).collect();
        let (file, sheets, files) = (file.to_path_buf(), Sheets::new(), files.clone());
        Self { file, text, ends, files, found: Vec::new(), of_nodes: Vec::new(), sheets }
    }

    /// Returns the EDS files read so far, which joints share.
    pub const fn sheets(&mut self) -> &mut Sheets {
        &mut self.sheets
    }

    /// Returns the source of further files that the configuration names.
    pub const fn files(&self) -> &Files {
        &self.files
    }

    /// Adds a problem with the reason: the violated constraint, and the value.
    pub fn add(&mut self, at: &impl HasPlace, reason: impl fmt::Display) {
        let problem = self.problem(at, reason);
        self.found.push(problem);
    }

    /// Adds a problem of a node without its name. Equal problems of several joints are merged into one that lists the
    /// joints.
    pub fn add_of_node(&mut self, at: &impl HasPlace, reason: impl fmt::Display) {
        self.add_of(String::new(), at, reason);
    }

    /// Adds a problem like [`add_of_node`](Self::add_of_node); `name` precedes the reason of a problem that is not merged.
    pub fn add_of(&mut self, name: String, at: &impl HasPlace, reason: impl fmt::Display) {
        let problem = self.problem(at, reason);
        self.of_nodes.push((name, problem));
    }

    fn problem(&self, at: &impl HasPlace, reason: impl fmt::Display) -> Problem {
        let place = at.place();
        Problem {
            file: self.file.clone(),
            line: place.line(),
            key: place.key().to_owned(),
            // Problems are lines: a value must not make another one.
            reason: reason.to_string().replace('\n', "\\n"),
        }
    }

    /// Adds an error of the TOML parser, or of a value of another type, at the place of the error.
    pub fn add_error(&mut self, error: &toml::de::Error) {
        self.add_error_at(&Place::new(String::new(), None), error);
    }

    /// As [`add_error`](Self::add_error), of the value at a place: the error may be of a value within it.
    pub fn add_error_at(&mut self, place: &Place, error: &toml::de::Error) {
        let offset = error.span().map(|span| span.start);
        let key = offset.map(|offset| toml_input::key_at(self.text, offset)).unwrap_or_default();
        self.found.push(Problem {
            file: self.file.clone(),
            line: offset.and_then(|offset| self.line_at(offset)),
            key: if key.is_empty() { place.key().to_owned() } else { key },
            reason: toml_input::message(self.text, error),
        });
    }

    /// Parses the text of a file of this kind. Notes a text that is not TOML, and a file of another kind.
    pub(super) fn document<'d>(
        &mut self,
        text: &'d str,
        kind: FileKind,
    ) -> Option<Spanned<DeTable<'d>>> {
        let document = match DeTable::parse(text) {
            Err(_) if file_kind::is_eds(text) => {
                let (file, key) = (self.file.clone(), String::new());
                let reason = "is an EDS or DCF; `frhc check --eds FILE` checks it".to_owned();
                self.found.push(Problem { file, line: None, key, reason });
                return None;
            }
            parsed => parsed.map_err(|error| self.add_error(&error)).ok()?,
        };
        match FileKind::from_keys(document.get_ref()) {
            Some(other) if other != kind => {
                let (file, key) = (self.file.clone(), String::new());
                let reason = format!("is {other}");
                self.found.push(Problem { file, line: None, key, reason });
                None
            }
            Some(_) | None => Some(document),
        }
    }

    /// Returns the line, from 1, of a byte offset; `None` behind the text, where the values of settings are.
    pub fn line_at(&self, offset: usize) -> Option<usize> {
        (offset <= self.text.len()).then(|| 1 + self.ends.partition_point(|end| *end < offset))
    }

    /// Adds the problems of another file that this file names.
    pub fn absorb(&mut self, other: Invalid) {
        self.found.extend(other.0);
    }

    /// Returns the value of `Ok`, or adds the error at the place.
    pub fn take<T, E: fmt::Display>(
        &mut self,
        at: &impl HasPlace,
        result: Result<T, E>,
    ) -> Option<T> {
        result.map_err(|error| self.add(at, error)).ok()
    }

    /// Returns the number of problems found so far.
    pub const fn count(&self) -> usize {
        self.found.len() + self.of_nodes.len()
    }

    /// Returns the value of `Ok`. Adds the error like [`take`](Self::take), unless the count has grown since `before`: the
    /// error then follows from a problem already noted.
    pub fn take_unless_noted<T, E: fmt::Display>(
        &mut self,
        before: usize,
        at: &impl HasPlace,
        result: Result<T, E>,
    ) -> Option<T> {
        if self.count() > before { result.ok() } else { self.take(at, result) }
    }

    /// Returns whether a key within `at` has a problem, so that consequences need not be reported.
    pub fn is_noted_within(&self, at: &impl HasPlace) -> bool {
        let is_within = |problem: &Problem| {
            let rest = problem.key.strip_prefix(at.place().key());
            rest.is_some_and(|rest| rest.starts_with(['.', '[']))
        };
        self.found.iter().any(is_within)
    }

    /// Checks for a finite number.
    pub fn finite<const NEEDED: bool>(&mut self, value: &Value<f64, NEEDED>) -> Option<f64> {
        self.number(value, FINITE)
    }

    /// Checks for a finite number above zero.
    pub fn positive<const NEEDED: bool>(&mut self, value: &Value<f64, NEEDED>) -> Option<f64> {
        self.number(value, POSITIVE)
    }

    /// Checks for a finite number that is not below zero.
    pub fn not_negative<const NEEDED: bool>(&mut self, value: &Value<f64, NEEDED>) -> Option<f64> {
        self.number(value, NOT_NEGATIVE)
    }

    /// Checks for finite numbers.
    pub fn all_finite<const N: usize, const NEEDED: bool>(
        &mut self,
        value: &Value<List<f64, N>, NEEDED>,
    ) -> Option<[f64; N]> {
        self.numbers(value, FINITE)
    }

    /// Checks for finite numbers that are not below zero.
    pub fn none_negative<const N: usize>(
        &mut self,
        value: &Value<List<f64, N>>,
    ) -> Option<[f64; N]> {
        self.numbers(value, NOT_NEGATIVE)
    }

    /// Checks for finite numbers above zero.
    pub fn all_positive<const N: usize>(
        &mut self,
        value: &Value<List<f64, N>>,
    ) -> Option<[f64; N]> {
        self.numbers(value, POSITIVE)
    }

    fn number<const NEEDED: bool>(
        &mut self,
        value: &Value<f64, NEEDED>,
        constraint: Constraint,
    ) -> Option<f64> {
        let number = value.get()?;
        self.check(value, &[number], constraint);
        Some(number)
    }

    fn numbers<const N: usize, const NEEDED: bool>(
        &mut self,
        value: &Value<List<f64, N>, NEEDED>,
        constraint: Constraint,
    ) -> Option<[f64; N]> {
        let List(numbers) = value.get()?;
        self.check(value, &numbers, constraint);
        Some(numbers)
    }

    /// Notes the first number that does not satisfy a constraint.
    fn check(&mut self, at: &impl HasPlace, numbers: &[f64], (is_valid, must): Constraint) {
        if let Some(wrong) = numbers.iter().find(|number| !is_valid(**number)) {
            self.add(at, format_args!("must be {must}, got {wrong}"));
        }
    }

    /// Returns the value of `choices` with this name. Any other name is a problem.
    pub fn one_of<T: Copy, const NEEDED: bool>(
        &mut self,
        value: &Value<String, NEEDED>,
        choices: &[(&str, T)],
    ) -> Option<T> {
        let given = value.as_ref()?;
        let found = choices.iter().find(|(name, _)| name == given).map(|(_, choice)| *choice);
        if found.is_none() {
            let names: Vec<String> =
                choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
            let expected = names.join(" or ");
            self.add(value, format_args!("unknown value \"{given}\"; expected {expected}"));
        }
        found
    }

    /// Checks for a number in `range`.
    pub fn within<T: Copy + PartialOrd + fmt::Display, const NEEDED: bool>(
        &mut self,
        value: &Value<T, NEEDED>,
        range: RangeInclusive<T>,
    ) -> Option<T> {
        let number = value.get()?;
        if !range.contains(&number) {
            let (min, max) = (range.start(), range.end());
            self.add(value, format_args!("must be within {min}..={max}, got {number}"));
        }
        Some(number)
    }

    /// Returns `Ok` if no problem was found.
    ///
    /// # Errors
    /// Returns all problems, those of this file first, in the order of lines.
    pub fn finish(self) -> Result<(), Invalid> {
        let mut found = self.found;
        found.extend(merged(self.of_nodes));
        let own = self.file;
        found.sort_by_key(|problem| (problem.file != own, problem.line));
        if found.is_empty() { Ok(()) } else { Err(Invalid(found)) }
    }
}

/// Constraint on a number, and its text after "must be".
type Constraint = (fn(f64) -> bool, &'static str);

const FINITE: Constraint = (f64::is_finite, "finite");
const POSITIVE: Constraint = (|number| number.is_finite() && number > 0.0, "above zero");
const NOT_NEGATIVE: Constraint = (|number| number.is_finite() && number >= 0.0, "zero or above");

/// Merges equal problems of several joints at the key of the first one, with the numbers of all.
fn merged(of_nodes: Vec<(String, Problem)>) -> impl Iterator<Item = Problem> {
    let messages = of_nodes.into_iter().map(|(name, problem)| {
        let reason = problem.reason.clone();
        ((name, problem), reason)
    });
    let groups = grouped(messages).into_iter();
    groups.filter_map(|(nodes, reason)| {
        let joints: Vec<_> = nodes.iter().map(|(_, problem)| joint(&problem.key)).collect();
        let several = joints.iter().flatten().count() > 1;
        let names: Vec<_> =
            joints.into_iter().map(|joint| joint.unwrap_or("switch box".into())).collect();
        let (name, first) = nodes.into_iter().next()?;
        let reason = match (several, name.is_empty()) {
            (true, _) => format!("joints {}: {reason}", listed(&names)),
            (false, true) => reason,
            (false, false) => format!("{name}: {reason}"),
        };
        Some(Problem { reason, ..first })
    })
}

/// Returns the number of the joint of a key, from 1; `None` for keys of other sections.
fn joint(key: &str) -> Option<String> {
    let index: usize = key.strip_prefix("joint[")?.split(']').next()?.parse().ok()?;
    Some((index + 1).to_string())
}
