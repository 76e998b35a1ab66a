//! Maximum time for which a drive that receives no RPDOs may hold a torque before the node detects it.
//!
//! A drive with an RPDO timer stops when the timer expires. A drive without one holds its last target indefinitely. The
//! node therefore compares two consecutive readings of the drive with the targets that it sent. It reads the torque
//! demand (6074h) by TPDO, or the target torque (6071h) by SDO, one drive after the other.

use std::time::Duration;

use derive_more::Display;

use crate::parameters::Parameters;
use crate::protection::timer_tolerance;
use canopen::layout::{DEMAND_SYNCS, Direction};
use canopen::load::network::Assumptions;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::watchdog::LifeSign;

/// Number of cycles before a reading whose targets the drive may have applied at the reading.
pub const TAKEN_CYCLES: u32 = 5;

/// Number of consecutive torque demands that must differ from the targets.
const DEMANDS: u32 = 2;

/// Time after a disarm in which drives whose torque actual (6077h) comes with each SYNC show that they apply no torque.
const DISARM_TIMEOUT: Duration = Duration::from_millis(100);

/// Time after a disarm in which the torques ramp to zero, and a filtered torque actual follows.
const DISARM_RAMP: Duration = Duration::from_millis(80);

/// Means of detecting that a drive has lost its RPDOs.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum SeenBy {
    /// RPDO event timer of the drive (1400h:5).
    #[display("its RPDO timer")]
    RpdoTimer,
    /// Torque demand (6074h), by TPDO.
    #[display("6074h by TPDO")]
    Demand,
    /// Target torque (6071h), read by SDO.
    #[display("6071h by SDO")]
    Reading,
}

/// Maximum time of a held torque, and the means of detecting it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeldTorque {
    /// Means of detection.
    pub seen_by: SeenBy,
    /// Maximum time from the first target that differs from the held one to detection.
    pub time: Duration,
}

impl Parameters {
    /// Returns the maximum time of a held torque for each drive, in the order of the joints.
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

    /// Returns the time after a disarm in which the drives show that they apply no torque. Of drives without an RPDO timer it
    /// covers their slowest TPDO of torque actual (6077h), which may come at about every hundredth SYNC only.
    pub fn disarm_timeout(&self) -> Duration {
        let plans = self.node_plans();
        let drives = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
        let silent = drives.filter(|plan| seen_by(plan) != SeenBy::RpdoTimer);
        let syncs = silent.flat_map(torque_syncs).max().unwrap_or_default();
        DISARM_TIMEOUT.max(DISARM_RAMP + self.period * (TAKEN_CYCLES + u32::from(syncs) + 2))
    }

    /// Returns the time of detection by TPDO. It covers the cycles whose targets the drive may have applied, two TPDOs, and
    /// one cycle for the reception of the last.
    fn by_demand(&self) -> Duration {
        self.period * (TAKEN_CYCLES + DEMANDS * u32::from(DEMAND_SYNCS) + 1)
    }

    /// Returns the time of detection by SDO. It covers the cycles whose targets the drive may have applied, an upload from
    /// each of `drives`, and another request. The second upload from this drive and its reply follow.
    fn by_reading(&self, drives: usize) -> Duration {
        let gap = Duration::from_micros(Assumptions::default().sdo_gap_us.into());
        // Requests are sent at the end of a cycle, so one that is due just after it waits for the next.
        let cycles = gap.as_micros().div_ceil(self.period.as_micros().max(1)) + 1;
        let slot = self.period * u32::try_from(cycles).unwrap_or(u32::MAX);
        let slots = u32::try_from(drives).unwrap_or(u32::MAX).saturating_add(3);
        self.period * TAKEN_CYCLES + slot * slots
    }
}

/// Returns the means of detection that the plan of a drive provides.
fn seen_by(plan: &NodePlan) -> SeenBy {
    let is_demand = |mapped: &canopen::layout::MappedObject| mapped.object == Object::TORQUE_DEMAND;
    let transmitted = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Transmit);
    let mut services = transmitted.filter_map(|pdo| pdo.service.as_ref());
    if plan.watchdog(LifeSign::Rpdo).is_some() {
        SeenBy::RpdoTimer
    } else if services.any(|service| service.mapping.iter().any(is_demand)) {
        SeenBy::Demand
    } else {
        SeenBy::Reading
    }
}

/// Returns the SYNCs between two TPDOs of torque actual (6077h) of a drive.
fn torque_syncs(plan: &NodePlan) -> Option<u8> {
    let transmitted = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Transmit);
    let mut services = transmitted.filter_map(|pdo| pdo.service.as_ref());
    let of_torque = services
        .find(|service| service.mapping.iter().any(|it| it.object == Object::TORQUE_ACTUAL))?;
    Some(of_torque.transmission.0)
}

/// Returns the time of a drive's RPDO timer plus its tolerance; zero without a timer.
fn rpdo_timer(plan: &NodePlan) -> Duration {
    plan.watchdog(LifeSign::Rpdo).map_or(Duration::ZERO, |timer| {
        Duration::from_millis(timer.millis.into()) + timer_tolerance(timer.awaited)
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Config;

    #[test]
    fn disarm_timeout_covers_a_rare_torque_actual() {
        let file = Path::new("config/kraft_like.toml");
        let text = String::from_utf8(crate::files::read(file).unwrap()).unwrap();
        let (before, damper) = text.split_once("[controller.passivity]").unwrap();
        let undamped = format!("{before}{}", &damper[damper.find("\n[").unwrap()..]);
        let text = undamped.replace("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 0 ");
        let text = text.replace("max_force_n = 40.0", "max_force_n = 1.0");
        let silent = Config::parse(file, &text).unwrap();
        assert_eq!(silent.held_torques()[5].seen_by, SeenBy::Reading);
        // 6077h at every 107th SYNC, at 1 kHz.
        assert_eq!(silent.disarm_timeout(), Duration::from_millis(80 + 5 + 107 + 2));
        for file in crate::shipped::HAND_CONTROLLERS {
            let timeout = Config::load(Path::new(file)).unwrap().disarm_timeout();
            assert_eq!(timeout, Duration::from_millis(100), "{file}");
        }
    }

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
