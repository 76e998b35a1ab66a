//! What is wrong with a script, and where.

use std::ops::Range;

use thiserror::Error;
use toml::Spanned;

/// Sums of decimal fractions may differ by less than this, in s.
const ROUNDING: f64 = 1e-9;

/// Why a script is none, and where.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {problem}")]
pub struct ScenarioError {
    /// From 1.
    pub line: usize,
    /// What is wrong there.
    pub problem: Problem,
}

/// What cannot be followed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Problem {
    /// Not TOML, or not with these keys.
    #[error("{0}")]
    Toml(String),
    /// A number beyond its bounds, or none.
    #[error("{quantity} = {value} is not within {low} and {high}")]
    Number {
        /// Its key.
        quantity: &'static str,
        /// What stands there.
        value: f64,
        /// The least it may be.
        low: f64,
        /// The most it may be.
        high: f64,
    },
    /// The entries of a list must follow each other in time.
    #[error("begins at {at_s} s, when the one before it lasts until {free_s} s")]
    Order {
        /// When it begins.
        at_s: f64,
        /// When it could.
        free_s: f64,
    },
    /// A fault without what it needs.
    #[error("`{kind}` needs `{key}`")]
    Missing {
        /// The kind of fault.
        kind: String,
        /// What it needs.
        key: &'static str,
    },
    /// A key that this kind of fault does not have.
    #[error("`{key}` does not belong to `{kind}`")]
    Unrelated {
        /// The kind of fault.
        kind: String,
        /// What stands there all the same.
        key: String,
    },
    /// A value that the key does not have.
    #[error("{key} = {value} is not {wanted}")]
    Value {
        /// The key.
        key: &'static str,
        /// What stands there.
        value: String,
        /// What could.
        wanted: &'static str,
    },
}

/// A problem, and the bytes of the text that it is about.
pub(super) type Misplaced = (Range<usize>, Problem);

/// Numbers out of bounds, and those that are none, are a problem.
pub(super) fn within(
    quantity: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), Problem> {
    let is_within = (low..=high + ROUNDING).contains(&value);
    if is_within { Ok(()) } else { Err(Problem::Number { quantity, value, low, high }) }
}

/// The entries themselves, if they lie within the script and none begins before the one before it has
/// ended. `span` tells when one begins and ends.
pub(super) fn in_order<T>(
    entries: Vec<Spanned<T>>,
    seconds: f64,
    span: impl Fn(&T) -> Result<(f64, f64), Problem>,
) -> Result<Vec<T>, Misplaced> {
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

/// Whether what begins at `at_s` may, when it could from `free_s` on.
pub(super) fn follows(at_s: f64, free_s: f64) -> Result<(), Problem> {
    let is_after = at_s >= free_s - ROUNDING;
    if is_after { Ok(()) } else { Err(Problem::Order { at_s, free_s }) }
}
