//! Figures of a robot in another process: keys that may be absent, or that a kind of commanded side needs.

use std::ops::RangeInclusive;

use crate::problem::Problems;
use crate::value::Optional;

/// Reads a figure that may be absent. Outer `None`: a problem.
pub(super) fn optional(
    key: &Optional<f64>,
    range: RangeInclusive<f64>,
    problems: &mut Problems<'_>,
) -> Option<Option<f64>> {
    if key.is_absent() {
        return Some(None);
    }
    problems.within(key, range).map(Some)
}

/// Notes an absent figure, and what it is needed for.
pub(super) fn required(
    key: &Optional<f64>,
    name: &str,
    needed: &str,
    value: Option<Option<f64>>,
    problems: &mut Problems<'_>,
) -> Option<f64> {
    if key.is_absent() {
        problems.add(key, format_args!("missing field `{name}`, which {needed}"));
    }
    value?
}
