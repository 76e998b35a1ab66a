//! `[[joint.boot.write]]`: additional SDO downloads, which precede those of the plan.

use crate::drive_object::{self, ObjectWrite};
use crate::problem::Problems;
use crate::raw;
use canopen::eds::Eds;
use canopen::setting;

/// Reads the writes of one node. They must not name reserved objects or those of `limits`, which limit its torque.
pub(super) fn read(
    raw: &[raw::BootWrite],
    eds: Option<&Eds>,
    limits: &[ObjectWrite],
    problems: &mut Problems<'_>,
) -> Vec<ObjectWrite> {
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
