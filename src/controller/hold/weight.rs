//! Weight on a path: what an actuator cannot carry is refused before anything moves.

use thiserror::Error;

use crate::JointVector;
use crate::arm::{Arm, JointKind};
use crate::calibration::Calibration;
use units::numbering::Joint;

/// Postures of a path whose weight is checked.
const CHECKED: u8 = 50;

/// Weight on a path beyond the capacity of an actuator.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "actuator {actuator} would carry {needed:.2} {unit} on the way, its capacity is {capacity:.2} {unit}"
)]
pub struct TooHeavy {
    /// Actuator, which is that of the joint unless joints are coupled.
    pub actuator: Joint,
    /// In N·m or N.
    pub needed: f64,
    /// In N·m or N.
    pub capacity: f64,
    /// Unit of the torque.
    pub unit: &'static str,
}

/// Checks that every actuator can carry the described weight on the straight way from one posture to another.
///
/// # Errors
/// Returns the actuator with the greatest load beyond its capacity.
pub fn check(
    arm: &Arm<6>,
    calibration: &Calibration<6>,
    [from, to]: [&JointVector; 2],
) -> Result<(), TooHeavy> {
    let (capacities, kinds) = (calibration.max_torques(), arm.kinds());
    let mut worst: Option<TooHeavy> = None;
    for place in 0..=CHECKED {
        let q = from + (to - from) * (f64::from(place) / f64::from(CHECKED));
        let tau = calibration.coupling().at_actuators(&arm.gravity(&arm.posture(&q)));
        for (actuator, (tau, capacity)) in Joint::each(tau.iter().zip(capacities.iter())) {
            let is_worst =
                worst.is_none_or(|worst| tau.abs() / capacity > worst.needed / worst.capacity);
            if tau.abs() > *capacity && is_worst {
                let unit = match actuator.entry(&kinds) {
                    JointKind::Revolute => "N·m",
                    JointKind::Prismatic => "N",
                };
                worst = Some(TooHeavy { actuator, needed: tau.abs(), capacity: *capacity, unit });
            }
        }
    }
    worst.map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Link;
    use crate::calibration::{JointCalibration, TorqueCurve};
    use nalgebra::Isometry3;

    /// Six turning joints about y, one in the other, of which only the last has a mass, 0.5 m away.
    fn arm(mass: f64) -> Arm<6> {
        let mut links = [Link { range: [-3.0, 3.0], ..Link::TURNING }; 6];
        links[0].alpha = -std::f64::consts::FRAC_PI_2;
        links[5] = Link { mass, centre_of_mass: [0.5, 0.0, 0.0], ..links[5] };
        Arm::new(links, Isometry3::identity(), [0.0, 0.0, -9.81]).unwrap()
    }

    fn calibration() -> Calibration<6> {
        let curve = TorqueCurve::new([100.0, 0.0, 0.0], 6.0).unwrap();
        Calibration::new([JointCalibration::new(4_096, 40.0, 0, curve).unwrap(); 6])
    }

    #[test]
    fn weight_on_the_way_counts_and_not_its_ends_alone() {
        // Upright at both ends, and stretched out in between: 0.5 m times 9.81 m/s² times the mass.
        let up = std::f64::consts::FRAC_PI_2;
        let [from, to] = [up, -up].map(|first| JointVector::from([first, 0.0, 0.0, 0.0, 0.0, 0.0]));
        assert_eq!(check(&arm(1.2), &calibration(), [&from, &to]), Ok(()));
        let refused = check(&arm(1.3), &calibration(), [&from, &to]).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "actuator 1 would carry 6.38 N·m on the way, its capacity is 6.00 N·m"
        );
        assert_eq!(check(&arm(1.3), &calibration(), [&from, &from]), Ok(()), "no way");
    }
}
