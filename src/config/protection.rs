//! What the drives do by themselves: their timers, how fast they may turn, and how much force that allows.
//!
//! What is planned here is written and read back at every boot; the timers are proven then, and the force
//! is judged again by what was proven.

use std::f64::consts::TAU;
use std::time::Duration;

use crate::force_cap::ForceCap;
use crate::force_cap::Pushes;
use crate::force_cap::UNPROVEN;
use crate::joints::Joint;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::watchdog::Awaited;
use controller::JointVector;
use controller::Settings;
use controller::arm::JointKind;
use controller::arm::Link;
use controller::stability::push::PushedHand;

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

/// The fastest the motor of an actuator may turn (6080h), in turns per minute, rounded up, where no joint
/// behind it is faster than it may be.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "finite and not negative by its checks; a float that is too large becomes the largest number"
)]
pub(super) fn motor_speed(config: &Parameters, place: usize, joint: &Joint) -> u32 {
    let speeds = JointVector::from(config.joints.each_ref().map(|joint| joint.max_speed));
    let speeds = config.controller.calibration.coupling().fastest(&speeds);
    let fastest = SECOND_LAYER * speeds.iter().nth(place).copied().unwrap_or_default();
    (fastest * joint.gear_ratio.abs() / TAU * 60.0).ceil() as u32
}

/// Without what a drive of this EDS has not and need not have.
pub(super) fn as_far_as_it_has(plan: NodePlan, joint: &Joint) -> NodePlan {
    plan.lacking(|object| joint.eds.object(object).is_none())
}

/// How long a drive without a fresh RPDO takes to stop, if it has such a timer by its EDS; written as 0
/// where the file wants none.
pub(super) fn rpdo_timer(config: &Parameters, joint: &Joint) -> Option<u16> {
    let timer = Object::rpdo_communication(1, 5);
    joint.eds.object(timer).map(|_| config.safety.rpdo_timer_ms)
}

impl Parameters {
    /// Everything that may push the hand at once.
    pub fn force_cap(&self) -> ForceCap {
        let Settings { arm, calibration, channels, assist_fraction, extensions, .. } =
            &self.controller;
        let mass = self.safety.protection.effective_mass;
        let hand = PushedHand { arm, coupling: calibration.coupling(), mass };
        // Displaced from one end of the reach to the other; but no joint assists with more than its share.
        let by_law = channels.strongest_force(2.0 * self.reach());
        let by_capacity =
            || hand.by_actuators(&(calibration.max_torques() * assist_fraction.share()));
        let centring = if by_law > WEAK { by_law.min(by_capacity()) } else { by_law };
        let pushes = Pushes {
            reflected: self.controller.reflection.max_force(),
            centring,
            soft_stops: extensions.soft_stops.map_or(0.0, |stops| hand.by_soft_stops(&stops)),
        };
        ForceCap {
            pushes,
            damping: self.strongest_damping(),
            max_speed: self.plausibility.max_grip_speed,
            effective_mass: mass,
        }
    }

    /// Longest way from the base to the grip, in m.
    fn reach(&self) -> f64 {
        let links = self.joints.iter().map(|joint| {
            let Link { kind, a, d, range: [low, high], .. } = joint.link;
            let slides = match kind {
                JointKind::Revolute => 0.0,
                JointKind::Prismatic => low.abs().max(high.abs()),
            };
            a.hypot(d) + slides
        });
        links.sum::<f64>() + self.x_6_g.translation.vector.norm()
    }

    /// All dampers of translations together, in N·s/m.
    fn strongest_damping(&self) -> f64 {
        let Settings { damping, extensions, .. } = &self.controller;
        let [x, y, z, ..] = *damping.values();
        let passivity = extensions.passivity.map_or(0.0, |passivity| passivity.max_damping());
        let tank = extensions.tank.map_or(0.0, |tank| tank.max_damping());
        x.max(y).max(z) + passivity + tank
    }
}

/// Up to this force the return to centre need not be compared with what the joints can exert, in N.
const WEAK: f64 = 5.0;

/// Whether the force is too much even if every drive does what it is told.
pub(super) fn check(config: &Parameters, problems: &mut Problems<'_>) {
    let plans = config.node_plans();
    let drives = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
    let lasting = if config.safety.protection.proves_drives {
        drives.map(longest).max().unwrap_or(UNPROVEN)
    } else {
        UNPROVEN
    };
    let cap = config.force_cap();
    problems.take(cap.pushes.key(), cap.allows(lasting));
}

/// How long a drive may go on without its master, by what is planned: the quicker of its timers stops it.
fn longest(plan: &NodePlan) -> Duration {
    let timers = [Awaited::Rpdo, Awaited::Heartbeat].into_iter();
    let timers = timers.filter_map(|awaited| plan.watchdog(awaited));
    let lasting = timers.map(|dog| Duration::from_millis(dog.millis.into()) + grain(dog.awaited));
    lasting.min().unwrap_or(UNPROVEN)
}
