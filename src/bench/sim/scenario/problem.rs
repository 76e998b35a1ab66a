//! Errors in a scenario, with their lines.

use std::fmt;
use std::ops::Range;

use thiserror::Error;
use toml::Spanned;

/// Shortest duration of anything that takes time, in s.
pub(super) const MIN_DURATION: f64 = 1e-3;

/// Tolerance for sums of decimal fractions, in s.
const ROUNDING: f64 = 1e-9;

/// Error in a scenario, with line and key: `3: move[0].at_s: must be within 0..=5, got NaN`.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{line}: {}{}", prefix(.key), .problem.reason())]
pub struct ScenarioError {
    /// Line, from 1.
    pub line: usize,
    /// Key, as `move[0].at_s`; empty if unknown.
    pub key: String,
    /// Kind of the error, with its values.
    pub problem: Problem,
}

impl ScenarioError {
    /// Returns the error of a problem at a byte offset of `text`.
    pub(super) fn at(text: &str, offset: usize, problem: Problem) -> Self {
        let line = 1 + text.bytes().take(offset).filter(|byte| *byte == b'\n').count();
        let place = toml_input::key_at(text, offset);
        let is_named = |key: &str| place.rsplit('.').next() == Some(key);
        let key = match problem.key() {
            Some(key) if place.is_empty() => key.to_owned(),
            Some(key) if !is_named(key) => format!("{place}.{key}"),
            Some(_) | None => place,
        };
        Self { line, key, problem }
    }
}

fn prefix(key: &str) -> String {
    if key.is_empty() { String::new() } else { format!("{key}: ") }
}

/// Kinds of errors.
#[derive(Clone, Debug, PartialEq)]
pub enum Problem {
    /// Invalid TOML, or unknown keys.
    Toml(String),
    /// Number out of its range, or NaN.
    Number {
        /// Key.
        quantity: &'static str,
        /// Value given.
        value: f64,
        /// Lower limit.
        low: f64,
        /// Upper limit.
        high: f64,
    },
    /// Entries of a list that overlap in time.
    Order {
        /// Begin of the entry.
        at_s: f64,
        /// End of the entry before.
        free_s: f64,
    },
    /// Key that the kind of fault requires.
    Missing {
        /// Kind of fault.
        kind: String,
        /// Missing key.
        key: &'static str,
    },
    /// Key that the kind of fault does not have.
    Unrelated {
        /// Kind of fault.
        kind: String,
        /// Key given.
        key: String,
    },
    /// Invalid value of a key.
    Value {
        key: &'static str,
        /// Value given.
        value: String,
        /// Values allowed.
        wanted: &'static str,
    },
}

/// Writes key and reason: `at_s: must be within 0..=5, got NaN`.
impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", prefix(self.key().unwrap_or_default()), self.reason())
    }
}

impl std::error::Error for Problem {}

impl Problem {
    /// Returns the last part of the key; `None` for invalid TOML, whose place has it.
    fn key(&self) -> Option<&str> {
        match self {
            Self::Toml(_) => None,
            Self::Number { quantity: key, .. }
            | Self::Missing { key, .. }
            | Self::Value { key, .. } => Some(key),
            Self::Order { .. } => Some("at_s"),
            Self::Unrelated { key, .. } => Some(key),
        }
    }

    /// Returns the violated constraint, and the value.
    fn reason(&self) -> String {
        match self {
            Self::Toml(message) => message.clone(),
            Self::Number { value, low, high, .. } => {
                format!("must be within {low}..={high}, got {value}")
            }
            Self::Order { at_s, free_s } => {
                format!("must be at least {free_s}, the end of the entry before, got {at_s}")
            }
            Self::Missing { kind, .. } => format!("missing; `{kind}` needs it"),
            Self::Unrelated { kind, .. } => format!("does not belong to `{kind}`"),
            Self::Value { value, wanted, .. } => format!("must be {wanted}, got {value}"),
        }
    }
}

/// Problem, and its byte range in the text.
pub(super) type LocatedProblem = (Range<usize>, Problem);

/// Checks a range; NaN is out of range.
pub(super) fn within(
    quantity: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), Problem> {
    let is_within = (low..=high + ROUNDING).contains(&value);
    if is_within { Ok(()) } else { Err(Problem::Number { quantity, value, low, high }) }
}

/// Returns the entries if they lie within the scenario and do not overlap. `span` returns begin and end of one.
pub(super) fn in_order<T>(
    entries: Vec<Spanned<T>>,
    seconds: f64,
    span: impl Fn(&T) -> Result<(f64, f64), Problem>,
) -> Result<Vec<T>, LocatedProblem> {
    let mut free_s = 0.0;
    for entry in &entries {
        let follows = |(at_s, end)| {
            within("at_s", at_s, 0.0, seconds)?;
            follows(at_s, free_s)?;
            Ok(end)
        };
        free_s =
            span(entry.get_ref()).and_then(follows).map_err(|problem| (entry.span(), problem))?;
    }
    Ok(entries.into_iter().map(Spanned::into_inner).collect())
}

/// Checks that an entry begins after the end of the one before.
pub(super) fn follows(at_s: f64, free_s: f64) -> Result<(), Problem> {
    let is_after = at_s >= free_s - ROUNDING;
    if is_after { Ok(()) } else { Err(Problem::Order { at_s, free_s }) }
}
