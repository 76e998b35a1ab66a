//! Errors in a scenario, with their lines.

use std::ops::Range;

use thiserror::Error;
use toml::Spanned;

/// Shortest duration of anything that takes time, in s.
pub(super) const MIN_DURATION: f64 = 1e-3;

/// Tolerance for sums of decimal fractions, in s.
const ROUNDING: f64 = 1e-9;

/// Error in a scenario, with its line.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {problem}")]
pub struct ScenarioError {
    /// Line, from 1.
    pub line: usize,
    /// Kind of the error, with key and values.
    pub problem: Problem,
}

/// Kinds of errors.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Problem {
    /// Invalid TOML, or unknown keys.
    #[error("{0}")]
    Toml(String),
    /// Number out of its range, or NaN.
    #[error("{quantity} must be within {low}..={high}, got {value}")]
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
    #[error("at_s must be at least {free_s}, the end of the entry before, got {at_s}")]
    Order {
        /// Begin of the entry.
        at_s: f64,
        /// End of the entry before.
        free_s: f64,
    },
    /// Key that the kind of fault requires.
    #[error("`{kind}` needs `{key}`")]
    Missing {
        /// Kind of fault.
        kind: String,
        /// Missing key.
        key: &'static str,
    },
    /// Key that the kind of fault does not have.
    #[error("`{key}` does not belong to `{kind}`")]
    Unrelated {
        /// Kind of fault.
        kind: String,
        /// Key given.
        key: String,
    },
    /// Invalid value of a key.
    #[error("{key} must be {wanted}, got {value}")]
    Value {
        key: &'static str,
        /// Value given.
        value: String,
        /// Values allowed.
        wanted: &'static str,
    },
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
