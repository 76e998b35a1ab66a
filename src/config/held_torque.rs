//! Longest time for which the torque of a drive that no longer receives its RPDOs may differ from its targets unseen.
//!
//! A drive with an RPDO timer stops by itself. One without holds its last target for good, so the node compares the
//! target that the drive has taken with those it sent: the torque demand (6074h) that arrives by TPDO, or the target
//! torque (6071h) read by SDO, one drive after the other. Two readings in a row must differ.

use std::time::Duration;

use derive_more::Display;

use crate::parameters::Parameters;
use crate::protection::timer_tolerance;
use canopen::layout::{DEMAND_SYNCS, Direction};
use canopen::load::network::Assumptions;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::watchdog::Awaited;
use units::numbering::Joint;

/// Cycles before a reading in which the target that a drive has taken may have been sent.
pub const TAKEN_CYCLES: u32 = 5;

/// Torque demands in a row that must differ.
const DEMANDS: u32 = 2;

/// Means by which the loss of a drive's RPDOs is seen.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum SeenBy {
    /// The drive's own RPDO timer.
    #[display("its RPDO timer")]
    RpdoTimer,
    /// Its torque demand (6074h), by TPDO.
    #[display("6074h by TPDO")]
    Demand,
    /// Its target torque (6071h), by SDO.
    #[display("6071h by SDO")]
    Reading,
}

/// Longest time of a held torque, and the means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeldTorque {
    /// Means by which it is seen.
    pub seen_by: SeenBy,
    /// Longest time from the first target that differs from the held one until then.
    pub time: Duration,
}

impl Parameters {
    /// Returns the longest time of a held torque of each drive, in the order of the joints.
    pub fn held_torques(&self) -> Vec<HeldTorque> {
        let plans = self.node_plans();
        let drives = || plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
        let read = drives().filter(|plan| seen_by(plan) == SeenBy::Reading).count();
        let of = |plan: &NodePlan| {
            let seen_by = seen_by(plan);
            let time = match seen_by {
                SeenBy::RpdoTimer => rpdo_timer(plan),
                SeenBy::Demand => self.by_demand(),
                SeenBy::Reading => self.by_reading(read),
            };
            HeldTorque { seen_by, time }
        };
        drives().map(of).collect()
    }

    /// Returns the longest time for which a drive may hold another torque than its targets before that is seen.
    pub fn held_torque_time(&self, joint: Joint) -> Duration {
        self.held_torques().get(joint.index()).map_or(Duration::ZERO, |held| held.time)
    }

    /// Until the target has left the cycles in which the drive may have taken it, two TPDOs, and one cycle for the last.
    fn by_demand(&self) -> Duration {
        self.period * (TAKEN_CYCLES + DEMANDS * u32::from(DEMAND_SYNCS) + 1)
    }

    /// Until the target has left the cycles in which the drive may have taken it, one turn of all `drives` that are read, a
    /// request of another kind, the second reading of this drive, which follows at once, and its reply.
    fn by_reading(&self, drives: usize) -> Duration {
        let gap = Duration::from_micros(Assumptions::default().sdo_gap_us.into());
        // A request leaves at the end of a cycle, so one that is a moment too early waits for the next.
        let cycles = gap.as_micros().div_ceil(self.period.as_micros().max(1)) + 1;
        let slot = self.period * u32::try_from(cycles).unwrap_or(u32::MAX);
        let slots = u32::try_from(drives).unwrap_or(u32::MAX).saturating_add(3);
        self.period * TAKEN_CYCLES + slot * slots
    }
}

/// Returns the means by which the plan of a drive provides.
fn seen_by(plan: &NodePlan) -> SeenBy {
    let is_demand = |mapped: &canopen::layout::Mapped| mapped.object == Object::TORQUE_DEMAND;
    let transmitted = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Transmit);
    let mut services = transmitted.filter_map(|pdo| pdo.service.as_ref());
    if plan.watchdog(Awaited::Rpdo).is_some() {
        SeenBy::RpdoTimer
    } else if services.any(|service| service.mapping.iter().any(is_demand)) {
        SeenBy::Demand
    } else {
        SeenBy::Reading
    }
}

/// Returns the time of a drive's RPDO timer with its tolerance; zero without one.
fn rpdo_timer(plan: &NodePlan) -> Duration {
    plan.watchdog(Awaited::Rpdo).map_or(Duration::ZERO, |timer| {
        Duration::from_millis(timer.millis.into()) + timer_tolerance(timer.awaited)
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Config;

    #[test]
    fn shipped_drives_show_a_held_torque_by_what_they_have() {
        for (file, seen_by, millis) in [
            ("config/kraft_like.toml", SeenBy::RpdoTimer, 6),
            ("config/drives/ingenia_eve.toml", SeenBy::RpdoTimer, 9),
            ("config/drives/elmo_gold.toml", SeenBy::Demand, 52),
            ("config/drives/nanotec_cl4e.toml", SeenBy::Demand, 52),
            ("config/drives/maxon_epos4.toml", SeenBy::Reading, 118),
            ("config/drives/technosoft_ipos.toml", SeenBy::Reading, 118),
        ] {
            let held = Config::load(Path::new(file)).unwrap().held_torques();
            let expected = HeldTorque { seen_by, time: Duration::from_millis(millis) };
            assert_eq!(held, [expected; 6], "{file}");
        }
    }
}
