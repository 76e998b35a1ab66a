//! Check of the commanded forces against the reaction time of the drives' own timers.
//!
//! Every boot writes the timers, reads them back and proves them. The forces are then checked against the proven times.

use std::time::Duration;

use crate::facts::Facts;
use crate::force_cap::{Dampers, ForceCap, Forces, Summand};
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use crate::value::HasPlace;
use canopen::watchdog::LifeSign;
use controller::Settings;
use controller::arm::{JointKind, Link};
use controller::stability::push::PushedHand;
use units::math;

/// Returns the tolerance of a timer for transmission of its frame and for its resolution.
pub const fn timer_tolerance(awaited: LifeSign) -> Duration {
    match awaited {
        LifeSign::Rpdo => Duration::from_millis(1),
        // A heartbeat may be late by up to a tenth of its period.
        LifeSign::Heartbeat => Duration::from_millis(3),
        // As for a heartbeat; the resolution of the drive's timer is unknown.
        LifeSign::Guarding => Duration::from_millis(3),
    }
}

impl Parameters {
    /// Returns the maximum forces that may act on the hand at the same time.
    pub fn force_cap(&self) -> ForceCap {
        let Settings { arm, calibration, channels, assist_fraction, extensions, .. } =
            &self.controller;
        let mass = self.safety.protection.effective_mass;
        let hand = PushedHand { arm, coupling: calibration.coupling(), mass };
        // At the largest displacement, from one end of the reach to the other, bounded by the assist share of the joints.
        let by_law = channels.strongest_force(2.0 * self.reach());
        let by_capacity =
            || hand.by_actuators(&(calibration.max_torques() * assist_fraction.share()));
        let centring = if by_law > WEAK { by_law.min(by_capacity()) } else { by_law };
        let forces = Forces {
            reflected: self.controller.reflection.max_force(),
            centring,
            soft_stops: extensions.soft_stops.map_or(0.0, |stops| hand.by_soft_stops(&stops)),
        };
        ForceCap {
            forces,
            dampers: self.dampers(),
            max_speed: self.plausibility.max_grip_speed,
            effective_mass: mass,
            is_halved: !self.facts().iter().all(Facts::is_verified),
        }
    }

    /// Returns the maximum distance from the base to the grip, in m.
    fn reach(&self) -> f64 {
        let links = self.joints.iter().map(|joint| {
            let Link { kind, a, d, range: [low, high], .. } = joint.plant.link;
            let slides = match kind {
                JointKind::Revolute => 0.0,
                JointKind::Prismatic => low.abs().max(high.abs()),
            };
            math::hypot(a, d) + slides
        });
        links.sum::<f64>() + self.x_6_g.translation.vector.norm()
    }

    /// Returns the dampers of translations at their strongest.
    fn dampers(&self) -> Dampers {
        let Settings { damping, extensions, .. } = &self.controller;
        let [x, y, z, ..] = *damping.values();
        Dampers {
            constant: x.max(y).max(z),
            passivity: extensions.passivity.map_or(0.0, |passivity| passivity.max_damping()),
            tank: extensions.tank.map_or(0.0, |tank| tank.max_damping()),
        }
    }
}

/// Force of return to centre up to which the bound by joint capacities is not computed, in N.
const WEAK: f64 = 5.0;

/// Refuses forces above the maximum for the configured timers, at the key of the largest summand. A drive that nothing stops
/// is a problem of its own, from which no force follows.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    if config.stopping().iter().any(|stopping| stopping.watchdogs.is_empty()) {
        return;
    }
    let Err(refused) = config.force_cap().check(config.planned_reaction_time()) else { return };
    let given = &raw.controller;
    let place = match refused.largest() {
        Summand::Reflected => Some(given.max_force_n.place()),
        Summand::Centring => Some(given.centring_n.place()),
        Summand::SoftStops => given.soft_stops.as_ref().map(|stops| stops.push.place()),
        Summand::Damping => Some(given.damping_ns_per_m.place()),
        Summand::PassivityDamper => {
            given.passivity.as_ref().map(|passivity| passivity.max_damping_ns_per_m.place())
        }
        Summand::TankDamper => given.tank.as_ref().map(|tank| tank.max_damping_ns_per_m.place()),
    };
    problems.add(place.unwrap_or(given.place()), refused);
}
