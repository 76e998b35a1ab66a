//! Check of the commanded forces against the reaction time of the drives' own timers.
//!
//! Every boot writes the timers, reads them back and proves them. The forces are then checked against the proven times.

use std::time::Duration;

use crate::facts::Facts;
use crate::force_cap::{ForceCap, ForceKind, Forces};
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
            damping: self.strongest_damping(),
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

    /// Returns the sum of all dampers of translations, in N·s/m.
    fn strongest_damping(&self) -> f64 {
        let Settings { damping, extensions, .. } = &self.controller;
        let [x, y, z, ..] = *damping.values();
        let passivity = extensions.passivity.map_or(0.0, |passivity| passivity.max_damping());
        let tank = extensions.tank.map_or(0.0, |tank| tank.max_damping());
        x.max(y).max(z) + passivity + tank
    }
}

/// Force of return to centre up to which the bound by joint capacities is not computed, in N.
const WEAK: f64 = 5.0;

/// Refuses forces above the maximum for the configured timers.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let cap = config.force_cap();
    let given = &raw.controller;
    let place = match (cap.forces.largest(), &given.soft_stops) {
        (ForceKind::Reflected, _) => given.max_force_n.place(),
        (ForceKind::Centring, _) => given.centring_n.place(),
        (ForceKind::SoftStops, Some(stops)) => stops.push.place(),
        (ForceKind::SoftStops, None) => given.place(),
    };
    problems.take(place, cap.check(config.planned_reaction_time()));
}
