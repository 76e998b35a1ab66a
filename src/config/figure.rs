//! Figures of a robot in another process: optional keys that some kinds of commanded side require.

use std::ops::RangeInclusive;

use crate::problem::Problems;
use crate::value::Optional;

/// Reads an optional figure. Returns the outer `None` after a problem, the inner one if the key is absent.
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

/// Returns a required figure. An absent one is a problem; `needed` is the end of its message.
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
