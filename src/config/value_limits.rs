//! Values of a plan against the limits of a data sheet (LowLimit, HighLimit), before anything is wired.

use std::fmt;

use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::value::Placed;
use canopen::eds::{Eds, OutsideLimits};
use canopen::load::lacks;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::sdo::bytes;

/// A planned value that a drive may refuse, by its data sheet. It is written all the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caution {
    /// Name of the node.
    pub name: String,
    /// Value and limits.
    pub outside: OutsideLimits,
}

/// `joint 3 (elbow): 60C2h:1 must be within 1..=1 of the EDS, got 2; written all the same`
impl fmt::Display for Caution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let why = if self.outside.object == Object::CONSUMER_HEARTBEAT {
            "data sheets often limit it to the time alone; the boot shows whether the drive does"
        } else {
            "a drive that refuses it goes on without"
        };
        write!(f, "{}: {}; {why}", self.name, self.outside)
    }
}

impl Parameters {
    /// Planned values of the drives that their data sheets exclude, but that are written.
    pub fn cautions(&self) -> Vec<Caution> {
        let plans = self.node_plans();
        let drives = plans.iter().zip(&self.joints);
        drives.flat_map(|((_, plan), joint)| cautions(&joint.eds, plan)).collect()
    }
}

fn cautions(eds: &Eds, plan: &NodePlan) -> impl Iterator<Item = Caution> {
    let passing = outside(eds, plan).into_iter().filter(|(is_fatal, _)| !is_fatal);
    passing.map(|(_, outside)| Caution { name: plan.name.clone(), outside })
}

/// Refuses values without which a drive cannot boot. Those of PDOs are part of their layout.
pub(super) fn check(at: &impl Placed, eds: &Eds, plan: &NodePlan, problems: &mut Problems<'_>) {
    let fatal = outside(eds, plan).into_iter().filter(|(is_fatal, _)| *is_fatal);
    for (_, outside) in fatal.filter(|(_, outside)| !lacks::is_parameter(outside.object)) {
        problems.add_of(plan.name.clone(), at, outside);
    }
}

/// Values outside of their limits, and whether the boot fails if the drive keeps to these.
fn outside(eds: &Eds, plan: &NodePlan) -> Vec<(bool, OutsideLimits)> {
    let mut found: Vec<(bool, OutsideLimits)> = Vec::new();
    for setting in plan.settings() {
        let object = setting.check.object;
        let Some(described) = eds.object(object) else { continue };
        let is_fatal = setting.fails_beyond_limits();
        let checked = described.check_content(&bytes(&setting.check.expected), plan.node);
        if let Err(outside) = checked
            && !found.iter().any(|(_, other)| other.object == object)
        {
            found.push((is_fatal, outside));
        }
    }
    found
}
