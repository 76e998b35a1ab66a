//! Torque at which a joint at rest begins to move, as the configuration describes the arm: for a trial of one drive alone.

use crate::JointVector;
use crate::arm::Arm;
use crate::calibration::Calibration;
use units::numbering::Joint;

/// Most of the described weight that a trial lifts: mass and torque curve may be wrong together.
const WEIGHT: f64 = 1.6;

/// Most of the described dry friction that a trial overcomes: a joint that has rested breaks away at 2.5 times its friction in
/// motion, which may itself be half as much again as described.
const FRICTION: f64 = 4.0;

/// Distance by which centres of mass may be described wrongly, in m.
const CENTRES: f64 = 0.02;

/// Breakaway of the actuator of a joint, in N·m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Breakaway {
    /// Torque that carries the described weight, with its sign.
    pub weight: f64,
    /// Torque by which it may differ, if centres of mass are off by 2 cm.
    pub centres: f64,
    /// Described dry friction.
    pub friction: f64,
    /// Capacity: the end of the calibrated range.
    pub capacity: f64,
}

impl Breakaway {
    /// Returns the breakaway of an actuator with the arm at `q`, in rad or m. `dry_friction` is that of each joint, in N·m or N.
    pub fn new(
        arm: &Arm<6>,
        calibration: &Calibration<6>,
        dry_friction: &JointVector,
        q: &JointVector,
        actuator: Joint,
    ) -> Self {
        let coupling = calibration.coupling();
        let entry = |all: &JointVector| all.get(actuator.index()).copied().unwrap_or_default();
        // What may have either sign adds up over coupled joints.
        let total = |tau: &JointVector| {
            let of = |joint: Joint| {
                let alone = tau.iter().enumerate();
                let alone = alone.map(|(at, tau)| if at == joint.index() { *tau } else { 0.0 });
                entry(&coupling.at_actuators(&JointVector::from_iterator(alone))).abs()
            };
            Joint::ALL.into_iter().map(of).sum()
        };
        let posture = arm.posture(q);
        Self {
            weight: entry(&coupling.at_actuators(&arm.gravity(&posture))),
            centres: total(&arm.gravity_of_offsets(&posture, CENTRES)),
            friction: total(dry_friction),
            capacity: entry(&calibration.max_torques()),
        }
    }

    /// Returns the most torque that a trial may exert, in N·m or N.
    pub fn most(&self) -> f64 {
        let weight = self.weight.abs() + self.centres;
        (WEIGHT * weight + FRICTION * self.friction).min(self.capacity)
    }

    /// Returns the same as a share of the capacity, in ‰, rounded down.
    pub fn most_share(&self) -> u16 {
        (1..=1_000_u16)
            .take_while(|share| f64::from(*share) * self.capacity <= self.most() * 1e3)
            .last()
            .unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trial_is_bounded_by_weight_friction_and_capacity() {
        let breakaway = Breakaway { weight: -0.9, centres: 0.1, friction: 0.1, capacity: 8.0 };
        assert!((breakaway.most() - 2.0).abs() < 1e-12);
        assert_eq!(breakaway.most_share(), 250);
        let weak = Breakaway { capacity: 1.5, ..breakaway };
        assert_eq!((weak.most_share(), weak.most()), (1_000, 1.5));
        let light = Breakaway { weight: 0.0, centres: 0.0, friction: 0.0, capacity: 8.0 };
        assert_eq!(light.most_share(), 0, "nothing may be pushed");
    }
}
