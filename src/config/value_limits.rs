//! Check of planned values against the limits of the EDS (LowLimit and HighLimit, CiA 306).

use std::fmt;

use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::value::HasPlace;
use canopen::eds::{Eds, OutsideLimits};
use canopen::load::lacks;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::sdo::bytes;

/// Planned value outside the limits of the EDS, which the boot nevertheless writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caution {
    /// Name of the node.
    pub name: String,
    /// Object, value and limits.
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
    /// Returns the planned values of the drives that are outside the limits of their EDS, but are written nevertheless.
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

/// Refuses values outside the limits if the boot needs them. PDO parameters belong to the layout check.
pub(super) fn check(at: &impl HasPlace, eds: &Eds, plan: &NodePlan, problems: &mut Problems<'_>) {
    let fatal = outside(eds, plan).into_iter().filter(|(is_fatal, _)| *is_fatal);
    for (_, outside) in fatal.filter(|(_, outside)| !lacks::is_parameter(outside.object)) {
        problems.add_of(plan.name.clone(), at, outside);
    }
}

/// Returns the values outside their limits, each with whether the boot fails if the drive refuses it.
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
