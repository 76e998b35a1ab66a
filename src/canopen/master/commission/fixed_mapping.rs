//! PDO mapping that a node does not let its master write (CiA 301, 7.5.2.36 and 7.5.2.38: `const` or `ro`).
//!
//! It is read and compared instead: a layout that the node has anyway needs no write.

use canopen_rs::Value;

use crate::abort::AbortCode;
use crate::layout::MAPPINGS;
use crate::master::boot_error::Problem;
use crate::master::check::Check;
use crate::master::commission::Boot;
use crate::master::steps::{Action, Step};
use crate::object::Object;

impl Boot {
    /// Drops the current step, which the node refused and which would have cleared `mapping`. Its entries are compared
    /// from here on, not written.
    pub(super) fn compare_mapping(&mut self, mapping: Object, code: AbortCode) {
        self.steps.remove(self.at);
        for step in self.steps.iter_mut().skip(self.at) {
            match step {
                Step::Object(action, check) if check.object.index == mapping.index => {
                    *action = Action::Compare;
                }
                Step::Object(..)
                | Step::AwaitHeartbeat
                | Step::Reset(_)
                | Step::Read(_)
                | Step::CompareNameplate => {}
            }
        }
        self.fixed_mappings.push((mapping, code));
    }

    /// Adds the refusal to a problem with an entry of a mapping that could not be written.
    pub(super) fn of_fixed_mapping(&self, object: Object, problem: Problem) -> Problem {
        let mut fixed = self.fixed_mappings.iter();
        match fixed.find(|(mapping, _)| mapping.index == object.index) {
            Some((mapping, code)) => Problem::FixedMapping(*mapping, *code, Box::new(problem)),
            None => problem,
        }
    }
}

/// Returns whether a write sets the number of mapped objects to zero.
pub(super) fn is_clearing(check: &Check) -> bool {
    let Object { index, sub } = check.object;
    let is_mapping = MAPPINGS.iter().any(|indices| indices.contains(&index));
    is_mapping && sub == 0 && check.expected == Value::Unsigned8(0)
}
