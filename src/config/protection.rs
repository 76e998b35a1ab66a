//! What the drives do by themselves: their timers, how fast they may turn, and how much force that allows.
//!
//! What is planned here is written and read back at every boot; the timers are proven then, and the force
//! is judged again by what was proven.

use std::f64::consts::TAU;
use std::time::Duration;

use crate::canopen::object::Object;
use crate::canopen::plan::NodePlan;
use crate::canopen::watchdog::Awaited;
use crate::config::Config;
use crate::config::force_cap::ForceCap;
use crate::config::force_cap::UNPROVEN;
use crate::config::joints::Joint;
use crate::config::problem::Problems;
use crate::config::raw;

/// `[safety]`, as far as it is about the drives by themselves.
#[derive(Clone, Copy, Debug)]
pub struct Protection {
    /// Whether every drive must show at every boot that it stops by itself.
    pub proves_drives: bool,
    /// Of hand and grip, in kg.
    pub effective_mass: f64,
}

/// What a timer may take longer than it says: its frame on the way, and its own grain.
pub const fn grain(awaited: Awaited) -> Duration {
    match awaited {
        Awaited::Rpdo => Duration::from_millis(1),
        // A heartbeat may come up to a tenth of its period late without being late.
        Awaited::Heartbeat => Duration::from_millis(3),
    }
}

/// Checks those keys.
pub(super) fn protection(raw: &raw::Safety, problems: &mut Problems<'_>) -> Protection {
    let mass = problems.within("safety.effective_mass_kg", raw.effective_mass_kg, 0.1..=3.0);
    Protection { proves_drives: raw.prove_drives, effective_mass: mass }
}

/// How many times the speed at which the node stops its drive lets a joint have: the second layer.
const SECOND_LAYER: f64 = 1.25;

/// The fastest a joint's motor may turn (6080h), in turns per minute, rounded up.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "finite and not negative by its checks; a float that is too large becomes the largest number"
)]
pub(super) fn motor_speed(joint: &Joint) -> u32 {
    let fastest = SECOND_LAYER * joint.max_speed;
    (fastest * joint.gear_ratio.abs() / TAU * 60.0).ceil() as u32
}

/// Without what a drive of this EDS has not and need not have.
pub(super) fn as_far_as_it_has(plan: NodePlan, joint: &Joint) -> NodePlan {
    plan.lacking(|object| joint.eds.object(object).is_none())
}

/// How long a drive without a fresh RPDO takes to stop, if it has such a timer by its EDS; written as 0
/// where the file wants none.
pub(super) fn rpdo_timer(config: &Config, joint: &Joint) -> Option<u16> {
    let timer = Object::rpdo_communication(1, 5);
    joint.eds.object(timer).map(|_| config.safety.rpdo_timer_ms)
}

impl Config {
    /// The largest force, and whom it pushes.
    pub fn force_cap(&self) -> ForceCap {
        ForceCap {
            max_force: self.controller.reflection.max_force(),
            effective_mass: self.safety.protection.effective_mass,
        }
    }
}

/// Whether the force is too much even if every drive does what it is told.
pub(super) fn check(config: &Config, problems: &mut Problems<'_>) {
    let plans = config.node_plans();
    let drives = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
    let lasting = if config.safety.protection.proves_drives {
        drives.map(longest).max().unwrap_or(UNPROVEN)
    } else {
        UNPROVEN
    };
    problems.take("controller.max_force_n", config.force_cap().allows(lasting));
}

/// How long a drive may go on without its master, by what is planned: the quicker of its timers stops it.
fn longest(plan: &NodePlan) -> Duration {
    let timers = [Awaited::Rpdo, Awaited::Heartbeat].into_iter();
    let timers = timers.filter_map(|awaited| plan.watchdog(awaited));
    let lasting = timers.map(|dog| Duration::from_millis(dog.millis.into()) + grain(dog.awaited));
    lasting.min().unwrap_or(UNPROVEN)
}
