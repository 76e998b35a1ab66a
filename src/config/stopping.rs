//! Timers that stop a drive whose master has died, by its plan, and the force that follows from the slowest one.

use std::fmt;
use std::time::Duration;

use crate::force_cap::UNPROVEN_REACTION_TIME;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::protection::timer_tolerance;
use crate::raw;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::watchdog::Watchdog;

/// Timers that stop the drive of one joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stopping {
    /// Its timers, by the plan.
    pub watchdogs: Vec<Watchdog>,
}

impl Stopping {
    /// Returns what stops the drive of `plan`.
    pub(super) fn of(plan: &NodePlan) -> Self {
        Self { watchdogs: plan.watchdogs().collect() }
    }

    /// Maximum time for which the drive goes on without its master: the quickest of its timers stops it. `None` if
    /// nothing does.
    pub fn reaction_time(&self) -> Option<Duration> {
        let longest = |dog: &Watchdog| {
            Duration::from_millis(dog.millis.into()) + timer_tolerance(dog.awaited)
        };
        self.watchdogs.iter().map(longest).min()
    }
}

/// `RPDO timer 8 ms, heartbeat 25 ms`, or `nothing`
impl fmt::Display for Stopping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.watchdogs.is_empty() {
            return f.write_str("nothing");
        }
        let timers: Vec<_> = self.watchdogs.iter().map(Watchdog::to_string).collect();
        f.write_str(&timers.join(", "))
    }
}

impl Parameters {
    /// Timers that stop each drive, in the order of the joints.
    pub fn stopping(&self) -> Vec<Stopping> {
        let plans = self.node_plans();
        plans
            .iter()
            .filter(|(_, plan)| plan.is_drive())
            .map(|(_, plan)| Stopping::of(plan))
            .collect()
    }

    /// Maximum time for which any drive goes on without its master, by the plan.
    pub fn planned_reaction_time(&self) -> Duration {
        if !self.safety.protection.proves_drives {
            return UNPROVEN_REACTION_TIME;
        }
        let each = self.stopping();
        let longest = each.iter().map(|it| it.reaction_time().unwrap_or(UNPROVEN_REACTION_TIME));
        longest.max().unwrap_or(UNPROVEN_REACTION_TIME)
    }
}

/// Refuses drives that nothing stops, and an RPDO timer that no drive has.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let plans = config.node_plans();
    let drives = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
    let joints = config.joints.iter().zip(raw.joint.all());
    for (plan, (joint, raw)) in drives.zip(joints) {
        if Stopping::of(plan).watchdogs.is_empty() {
            let has = |object| joint.eds.object(object).is_some();
            let can_be_guarded = has(Object::GUARD_TIME) && has(Object::LIFE_TIME_FACTOR);
            let remedy = if has(Object::rpdo_communication(1, 5)) {
                "set safety.rpdo_timer_ms"
            } else if can_be_guarded {
                "guard it by joint.boot.guard_time_ms and life_time_factor"
            } else {
                "it would need 1016h (heartbeat consumer), 100Ch and 100Dh (node guarding) or 1400h:5 (RPDO timer)"
            };
            let name = &plan.name;
            let reason = format!("{name}: nothing stops the drive without its master; {remedy}");
            problems.add(&raw.eds, reason);
        }
    }
    let has_timer = |object| config.joints.iter().any(|joint| joint.eds.object(object).is_some());
    if config.safety.rpdo_timer_ms > 0 && !has_timer(Object::rpdo_communication(1, 5)) {
        let reason = "no drive has an RPDO timer (1400h:5) by its EDS; set it to 0";
        problems.add(&raw.safety.rpdo_timer_ms, reason);
    }
}
