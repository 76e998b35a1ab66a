//! Error of a stored value that differs from the configuration.

use thiserror::Error;

use crate::object::Object;

/// Stored value of a drive that is not the configured one.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{name} ({object}) is {found}, expected {expected}: {remedy}")]
pub struct NameplateMisfit {
    /// Name of the quantity.
    pub name: &'static str,
    /// Object, by its index.
    pub object: Object,
    /// Value found.
    pub found: String,
    /// Value of the configuration.
    pub expected: String,
    /// Instruction for the operator, which ends the message.
    pub remedy: &'static str,
}

/// Returns a number with as many digits as it needs, at most three behind the point.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
