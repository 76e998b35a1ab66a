//! Failed boots of several nodes, judged together: drives that are swapped, and nodes that are all silent.

use canopen::NodeId;
use canopen::master::Master;
use canopen::master::boot_error::{BootError, Problem};
use canopen::nameplate::Nameplate;
use canopen::plan::NodePlan;
use units::numbering::NodeIndex;
use units::wording;

/// Planned nameplates of the drives, to find out whose a drive holds.
#[derive(Clone, Debug)]
pub(super) struct ExpectedDrives(Vec<ExpectedDrive>);

#[derive(Clone, Debug)]
struct ExpectedDrive {
    /// Joint and drive: `joint 3 (elbow), node 3`.
    name: String,
    nameplate: Option<Nameplate>,
}

impl ExpectedDrives {
    /// Returns the drives of `plans`, by their indices in the master.
    pub(super) fn new<'a>(plans: impl Iterator<Item = &'a NodePlan>) -> Self {
        let drive = |plan: &NodePlan| ExpectedDrive {
            name: format!("{}, node {}", plan.name, plan.node.raw()),
            nameplate: plan.nameplate.clone(),
        };
        Self(plans.map(drive).collect())
    }

    /// Names the drives among `failed` that hold each other's nameplates.
    pub(super) fn name_swapped(&self, master: &Master, failed: &mut [BootError]) {
        let misfits: Vec<usize> = failed
            .iter()
            .filter(|error| is_misfit(error))
            .filter_map(|error| self.place(error))
            .collect();
        for error in failed.iter_mut() {
            let (Some(place), Problem::Misfit(misfit)) = (self.place(error), &error.problem) else {
                continue;
            };
            let held = master.nameplate(NodeIndex(place));
            let fits = |other: &&usize| {
                let other = self.0.get(**other).and_then(|other| other.nameplate.as_ref());
                other.is_some_and(|nameplate| nameplate.judge(held).is_ok())
            };
            let owner = misfits.iter().filter(|other| **other != place).find(fits);
            if let Some(owner) = owner.and_then(|owner| self.0.get(*owner)) {
                let (misfit, owner) = (misfit.clone(), owner.name.clone());
                error.problem = Problem::Swapped { misfit, owner };
            }
        }
    }

    fn place(&self, error: &BootError) -> Option<usize> {
        let name = format!("{}, node {}", error.name, error.node.raw());
        self.0.iter().position(|drive| drive.name == name)
    }
}

const fn is_misfit(error: &BootError) -> bool {
    matches!(error.problem, Problem::Misfit(_))
}

/// Remedy for several silent nodes, which have one likely reason.
const SILENT: &str = ": check power, cable, termination (120 Ω at both ends), and that they have the bit rate of their bus";

/// Returns one line for each error, with the names of all nodes that have it.
pub(super) fn lines(errors: &[BootError]) -> String {
    let is_silent = |error: &BootError| matches!(error.problem, Problem::Absent { .. });
    let are_several = errors.iter().filter(|error| is_silent(error)).count() > 1;
    grouped(errors.iter().map(|error| {
        let hint = if are_several && is_silent(error) { SILENT } else { "" };
        (error.name.as_str(), error.node, format!("{}{hint}", error.problem))
    }))
}

/// Returns one line for each error, with the names of all nodes that have it.
pub(super) fn grouped<'n>(errors: impl Iterator<Item = (&'n str, NodeId, String)>) -> String {
    let errors = errors.map(|(name, node, error)| ((name, node.raw()), error));
    let lines = wording::grouped(errors).into_iter().map(|(nodes, error)| match &nodes[..] {
        [(name, node)] => format!("{name}, node {node}: {error}"),
        several => {
            let numbers: Vec<_> = several.iter().map(|(_, node)| node).collect();
            format!("nodes {}: {error}", wording::listed(&numbers))
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BringUpError;
    use crate::silent_bus::node;

    #[test]
    fn silent_network_gets_one_line_with_what_to_check() {
        let mut node = node();
        let Err(BringUpError::Boot(errors)) = node.bring_up(&mut || false) else {
            panic!("booted without nodes");
        };
        let text = lines(&errors);
        assert_eq!(text.lines().count(), 1, "{text}");
        assert!(
            text.starts_with(
                "nodes 1, 2, 3, 4, 5, 6 and 16: does not answer, waited 2.0 s: check power"
            ),
            "{text}"
        );
        for word in ["cable", "termination", "bit rate"] {
            assert!(text.contains(word), "{word}: {text}");
        }
        let one = lines(&errors[..1]);
        assert_eq!(one, errors[0].to_string(), "a single node is named as before");
    }
}
