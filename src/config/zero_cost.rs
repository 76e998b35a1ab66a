//! Force at the grip that the tolerance of a zero costs: gravity compensation carries the weight of another posture.
//!
//! With the zero of joint j off by e, the force f on the hand is `J⁻ᵀ (g(q + e) - g(q))`. Its norm is greatest in some posture, which is
//! searched among those of a Halton sequence over the ranges of the joints.

use nalgebra::Vector3;

use crate::parameters::Parameters;
use controller::JointVector;
use units::numbering::Joint;

/// Number of postures.
const POSTURES: u32 = 400;

/// Bases of the sequence, one for each joint.
const BASES: [u32; 6] = [2, 3, 5, 7, 11, 13];

/// Smallest singular value of the Jacobian, in the units of m and rad, below which a posture is left out.
const MIN_SIGMA: f64 = 0.05;

impl Parameters {
    /// Returns the greatest force at the grip, in N, if the zero of each joint is off by the tolerance of its rest position;
    /// zero without one.
    pub fn zero_costs(&self) -> [f64; 6] {
        let mut most = [0.0_f64; 6];
        for place in 1..=POSTURES {
            let q = self.sampled_posture(place);
            for (joint, most) in Joint::each(&mut most) {
                let tolerance = joint.entry(&self.joints).rest.map_or(0.0, |rest| rest.tolerance());
                for error in [tolerance, -tolerance] {
                    *most = most.max(self.zero_error_force(&q, joint, error).unwrap_or(0.0));
                }
            }
        }
        most
    }

    /// Returns the posture of this number, from 1, within the ranges of the joints.
    fn sampled_posture(&self, place: u32) -> JointVector {
        let ranges = self.controller.arm.ranges();
        let at = ranges.into_iter().zip(BASES);
        JointVector::from_iterator(
            at.map(|([low, high], base)| low + (high - low) * radical_inverse(place, base)),
        )
    }

    /// Returns the force on the hand at `q` with the zero of a joint off by `error`, in N; `None` near a singularity.
    fn zero_error_force(&self, q: &JointVector, joint: Joint, error: f64) -> Option<f64> {
        let arm = &self.controller.arm;
        let posture = arm.posture(q);
        let jacobian = arm.jacobian(&posture).matrix();
        let least = self.contact_bounds.min_sigma.max(MIN_SIGMA);
        if jacobian.singular_values().min() < least {
            return None;
        }
        let mut read = *q;
        if let Some(position) = read.get_mut(joint.index()) {
            *position += error;
        }
        let tau = arm.gravity(&arm.posture(&read)) - arm.gravity(&posture);
        let wrench = jacobian.transpose().lu().solve(&tau)?;
        let force: Vector3<f64> = wrench.fixed_rows::<3>(0).into_owned();
        Some(force.norm())
    }
}

/// Returns the digits of `number` in `base`, mirrored behind the point.
fn radical_inverse(number: u32, base: u32) -> f64 {
    let (mut rest, mut digit, mut sum) = (number, 1.0, 0.0);
    while rest > 0 {
        digit /= f64::from(base);
        sum += digit * f64::from(rest % base);
        rest /= base;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequence_fills_the_interval() {
        let sequence: Vec<_> = (1..=4).map(|number| radical_inverse(number, 2)).collect();
        assert_eq!(sequence, [0.5, 0.25, 0.75, 0.125]);
    }

    #[test]
    fn five_degrees_at_the_elevation_cost_about_a_newton() {
        let config = crate::Config::load(std::path::Path::new("config/kraft_like.toml")).unwrap();
        let costs = config.zero_costs();
        assert!((0.9..1.8).contains(&costs[1]), "{costs:?}");
        assert!(costs[0] < 1e-9, "the azimuth turns about the vertical: {costs:?}");
    }
}
