//! `[[joint.boot.write]]`: SDO downloads of the laboratory's own, before those of the plan.

use crate::drive_object::{self, Written};
use crate::problem::Problems;
use crate::raw;
use canopen::eds::Eds;
use canopen::setting;

/// Reads the writes of one node, whose torque `limits` limit.
pub(super) fn read(
    raw: &[raw::BootWrite],
    eds: Option<&Eds>,
    limits: &[Written],
    problems: &mut Problems<'_>,
) -> Vec<Written> {
    let one = |write: &raw::BootWrite| {
        let (object, content) = drive_object::read(&write.object, &write.value, eds, problems)?;
        let is_limit = limits
            .iter()
            .any(|(limit, _)| *limit == object)
            .then_some("is the object of [joint.torque_limit]");
        if let Some(reason) = setting::reserved(object).or(is_limit) {
            problems.add(&write.object, format_args!("{object} {reason}"));
            return None;
        }
        Some((object, content))
    };
    raw.iter().filter_map(one).collect()
}
