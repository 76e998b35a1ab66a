//! Catalogue of the kinds of fault, each with its hazard and criterion.
//!
//! Limits are those of the [expectations](crate::expectation). Causes that may stop the node first are written here by hand.
//! Case numbers cycle through the kinds, so a number determines its kind.

mod buses;
mod devices;
mod frames;
mod operator;
mod zeros;

use crate::injection::Conditions;
use crate::kind::CaseKind;
use canopen::layout::{Pdo, Service};
use canopen::object::Object;
use units::numbering::Joint;

/// Returns all kinds, by group.
pub fn kinds() -> impl Iterator<Item = &'static CaseKind> {
    let groups: [&[CaseKind]; 5] =
        [devices::KINDS, frames::KINDS, buses::KINDS, operator::KINDS, zeros::KINDS];
    groups.into_iter().flatten()
}

/// Returns the PDO of a joint's drive with an object.
fn pdo_with(at: &Conditions<'_>, joint: Joint, object: Object) -> Option<Pdo> {
    let (_, plan) = at.config.node_plans().into_iter().nth(joint.index())?;
    let has_object =
        |service: &Service| service.mapping.iter().any(|mapped| mapped.object == object);
    plan.pdos.into_iter().find(|pdo| pdo.service.as_ref().is_some_and(has_object))
}

/// Former names of kinds, each with its present name.
pub const RENAMED: [(&str, &str); 6] = [
    ("SYNC not heard", "SYNC missing"),
    ("drive fault, untold", "drive fault, no emergency"),
    ("drive heartbeat says stopped", "drive heartbeat of another state"),
    ("process stands still", "process stopped"),
    ("wrench large, but may be", "wrench large, but valid"),
    ("wrench no number", "wrench not finite"),
];

/// Returns the kind of case `number`, from 1.
pub(super) fn kind_of(number: u32) -> Option<&'static CaseKind> {
    let count = kinds().count();
    let place = usize::try_from(number).ok()?.checked_sub(1)?;
    kinds().nth(place.checked_rem(count)?)
}

/// Returns the round of case `number`, from 0; a round has every kind once.
pub(super) fn round_of(number: u32) -> Option<usize> {
    usize::try_from(number).ok()?.checked_sub(1)?.checked_div(kinds().count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expectation;

    #[test]
    fn every_kind_has_an_expectation_with_one_of_its_causes() {
        let mut without: Vec<&str> = Vec::new();
        for kind in kinds() {
            let row = expectation::of_hazard(kind.hazard).unwrap();
            let is_expected = |(cause, _): &&(_, _)| kind.causes.contains(cause);
            let is_free = kind.causes.is_empty() || row.reactions.is_empty();
            let is_other = OTHER_CAUSES.contains(&kind.name);
            let is_known = row.reactions.iter().any(|reaction| is_expected(&reaction));
            if !(is_free || is_known || is_other) {
                without.push(kind.name);
            }
        }
        assert_eq!(without, <[&str; 0]>::default());
    }

    /// Kinds of a hazard that is detected by another cause than that of its stop.
    const OTHER_CAUSES: [&str; 6] = [
        "several drives unplugged",
        "process killed",
        "bus flooded",
        "stall within a cycle",
        "cradle missed",
        "cradle missed by a revolution",
    ];
}
