//! Times until drives stop without their master, from the timers of their plans. The proof test verifies these timers before
//! the first torque, so a campaign expects exactly them.
//!
//! | timer              | object       | time                                     |
//! |--------------------|--------------|------------------------------------------|
//! | RPDO timer         | 1400h:5      | value + 1 ms                             |
//! | heartbeat consumer | 1016h        | value + 3 ms                             |
//! | life guarding      | 100Ch, 100Dh | guard time × life time factor + 3 ms     |

use std::time::Duration;

use canopen::plan::NodePlan;
use canopen::watchdog::{LifeSign, Watchdog};
use config::{Config, Layout, timer_tolerance};

/// Returns the time from the last frame of the master until the slowest drive exerts no torque, by the shortest timer of
/// each drive.
pub fn slowest(config: &Config) -> Duration {
    let quickest = |plan: &NodePlan| plan.watchdogs().map(within).min();
    each(config, quickest).into_iter().flatten().max().unwrap_or_default()
}

/// Returns the time from the last RPDO until the slowest drive exerts no torque; `None` if a drive has no RPDO timer.
pub fn rpdo(config: &Config) -> Option<Duration> {
    let times = each(config, |plan| plan.watchdog(LifeSign::Rpdo).map(within));
    times.into_iter().try_fold(Duration::ZERO, |slowest, time| Some(slowest.max(time?)))
}

/// Returns the maximum age at which a torque can begin to act after a delay by an adapter, or in a drive without SYNC. It is
/// the time of the RPDO timer, else of the shortest other timer with its tolerance, plus a period.
pub fn oldest_torque(config: &Config) -> Duration {
    let age = |plan: &NodePlan| match plan.watchdog(LifeSign::Rpdo) {
        Some(timer) => Some(Duration::from_millis(u64::from(timer.millis))),
        None => plan.watchdogs().map(within).min(),
    };
    each(config, age).into_iter().flatten().max().unwrap_or_default() + config.period
}

/// Returns the time from a lost "disable voltage" until the drive is off by SDO (6040h = 0): 10 ms after its statusword. The
/// statusword takes two cycles, or 25 ms in the grouped layout, which sends one controlword at a time.
pub fn power_off_by_sdo(config: &Config) -> Duration {
    let takes_turns = config.buses.iter().any(|bus| bus.layout == Layout::Grouped);
    let statusword = if takes_turns { Duration::from_millis(25) } else { config.period * 2 };
    statusword + Duration::from_millis(10)
}

/// Returns the time within which a timer ends torque, tolerance included.
fn within(timer: Watchdog) -> Duration {
    Duration::from_millis(u64::from(timer.millis)) + timer_tolerance(timer.awaited)
}

/// Returns the result of `time` for each drive.
fn each(config: &Config, time: impl Fn(&NodePlan) -> Option<Duration>) -> Vec<Option<Duration>> {
    let plans = config.node_plans();
    plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive()).map(time).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn expected_times_are_those_of_the_proven_timers() {
        // RPDO timers of 5 and 8 ms, heartbeat consumers of 22 ms, life guarding of 3 times 10 ms.
        for (file, timers, oldest) in [
            ("kraft_like", [6, 6], 6),
            ("kraft_like_500hz", [9, 9], 10),
            ("drives/ingenia_eve", [9, 9], 10),
            ("drives/maxon_epos4", [25, 0], 27),
            ("drives/technosoft_ipos", [33, 0], 35),
        ] {
            let config = Config::load(Path::new(&format!("config/{file}.toml"))).unwrap();
            let found = [slowest(&config), rpdo(&config).unwrap_or_default()];
            assert_eq!(found, timers.map(Duration::from_millis), "{file}");
            assert_eq!(oldest_torque(&config), Duration::from_millis(oldest), "{file}");
        }
    }
}
