//! Posture of the arm in contact, and the quality of force rendering there.
//!
//! The grip moves on a straight line at constant orientation, by Newton's method on the Jacobian. Near a singularity,
//! joint friction and torque errors are amplified at the grip.

use nalgebra::{Isometry3, SMatrix, SVector, Vector3};
use thiserror::Error;

use crate::JointVector;
use crate::arm::Arm;
use units::spatial::{Jacobian, Twist};

/// Maximum step along the path, in m, within which Newton's method converges from the previous posture.
const STEP: f64 = 5e-3;

/// Newton iterations per step.
const ITERATIONS: u32 = 8;

/// Residual of convergence, in m and rad.
const TOLERANCE: f64 = 1e-7;

/// Maximum number of steps of a path: 50 m.
const MAX_STEPS: f64 = 1e4;

/// Posture with its force rendering along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPosture {
    /// Joint positions, in rad or m.
    pub q: JointVector,
    /// Smallest singular value of the Jacobian at {G}, with rates in rad/s or m/s and twists in m/s and rad/s.
    pub sigma_min: f64,
    /// Dry friction of all joints along the direction of the push, in N: `Σ_j |(J⁻¹)_j n| c_j`. Infinite at a singularity.
    pub friction_n: f64,
}

/// Bounds of a posture with acceptable force rendering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostureBounds {
    /// Minimum of the smallest singular value, in the units of [`ContactPosture::sigma_min`].
    pub min_sigma: f64,
    /// Maximum dry friction along the push, in N.
    pub max_friction_n: f64,
}

impl PostureBounds {
    /// Returns whether a posture is within the bounds.
    pub fn permit(&self, posture: &ContactPosture) -> bool {
        posture.sigma_min >= self.min_sigma && posture.friction_n <= self.max_friction_n
    }
}

/// Bounds that every posture satisfies.
impl Default for PostureBounds {
    fn default() -> Self {
        Self { min_sigma: 0.0, max_friction_n: f64::INFINITY }
    }
}

/// Reason why the arm does not reach a pose.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum OutOfReach {
    /// Newton's method does not converge: no posture reaches the pose.
    #[error("no posture of the arm reaches it: the way ends after {reached:.3} m")]
    NoPosture {
        /// Length of the path that is reachable, in m.
        reached: f64,
    },
    /// Newton's method does not converge in the first step: the start is singular, or at the end of the arm's reach.
    #[error(
        "the arm starts in a singular posture, or at the end of its reach: smallest singular value {sigma_min:.3}"
    )]
    AtStart {
        /// Smallest singular value of the Jacobian at the start, in the units of [`ContactPosture::sigma_min`].
        sigma_min: f64,
    },
    /// Gain that is too small for any displacement of the grip to move the object to the pose.
    #[error("controller.pose_gain along {axis} of the grip moves the object nowhere, got {gain}")]
    NoGain {
        /// Axis of {G0}.
        axis: char,
        /// Its gain.
        gain: f64,
    },
    /// Path on which a joint leaves its range.
    #[error("joint {joint} would leave its range")]
    JointRange {
        /// Joint number, from 1.
        joint: usize,
    },
}

impl ContactPosture {
    /// Evaluates the posture `q` with Jacobian `j_g`, for a push along the unit vector `n_g` in {G}. `coulomb` is the dry
    /// friction of the joints, in N·m or N.
    pub fn new(
        q: &JointVector,
        j_g: &Jacobian<6>,
        n_g: &Vector3<f64>,
        coulomb: &JointVector,
    ) -> Self {
        let matrix = j_g.matrix();
        let sigma_min = matrix.singular_values().min();
        let along = SVector::from([n_g.x, n_g.y, n_g.z, 0.0, 0.0, 0.0]);
        let rates = matrix.try_inverse().map(|inverse: SMatrix<f64, 6, 6>| inverse * along);
        let friction_n = rates.map_or(f64::INFINITY, |qd| qd.abs().dot(coulomb));
        Self { q: *q, sigma_min, friction_n }
    }

    /// Moves the grip from `q` along the straight `path`, in {0} in m, and evaluates the posture for a push along it.
    ///
    /// # Errors
    /// Returns the reachable length if a pose is out of reach, or the first joint that leaves its range.
    pub fn after(
        arm: &Arm<6>,
        q: &JointVector,
        path: &Vector3<f64>,
        coulomb: &JointVector,
    ) -> Result<Self, OutOfReach> {
        let x_0_first = arm.forward(q);
        let length = path.norm();
        if !length.is_finite() {
            return Err(OutOfReach::NoPosture { reached: 0.0 });
        }
        let steps = (length / STEP).ceil().clamp(1.0, MAX_STEPS);
        let (start, mut q, mut step) = (q, *q, 0.0);
        while step < steps {
            let reached = length * step / steps;
            step += 1.0;
            let mut x_0_g = x_0_first;
            x_0_g.translation.vector += path * (step / steps);
            q = solved(arm, &q, &x_0_g).ok_or_else(|| no_posture(arm, start, reached))?;
            if let Some(place) = arm.out_of_range(&q) {
                return Err(OutOfReach::JointRange { joint: place + 1 });
            }
        }
        let posture = arm.posture(&q);
        let n_g = posture.x_0_g.rotation.inverse() * path.try_normalize(0.0).unwrap_or_default();
        Ok(Self::new(&q, &arm.jacobian(&posture), &n_g, coulomb))
    }
}

/// Returns the reason why a path from `start` ends after `reached` m.
fn no_posture(arm: &Arm<6>, start: &JointVector, reached: f64) -> OutOfReach {
    if reached > 0.0 {
        return OutOfReach::NoPosture { reached };
    }
    let sigma_min = arm.jacobian(&arm.posture(start)).matrix().singular_values().min();
    OutOfReach::AtStart { sigma_min }
}

/// Solves for joint positions near `q` with the grip at `x_0_g`, by Newton's method. `None` without convergence.
fn solved(arm: &Arm<6>, q: &JointVector, x_0_g: &Isometry3<f64>) -> Option<JointVector> {
    let mut q = *q;
    for _ in 0..ITERATIONS {
        let posture = arm.posture(&q);
        let missing = Twist::reaching(&(posture.x_0_g.inverse() * x_0_g), 1.0);
        let missing = SVector::from(missing.components());
        if missing.amax() < TOLERANCE {
            return Some(q);
        }
        q += arm.jacobian(&posture).matrix().try_inverse()? * missing;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Link;

    /// Returns an arm with a planar chain of three joints, links of 0.25 m, and three joints for orientation at the grip.
    fn arm() -> Arm<6> {
        let quarter = std::f64::consts::FRAC_PI_2;
        let link = |alpha, a| Link { alpha, a, ..Link::TURNING };
        let links = [
            link(0.0, 0.0),
            link(-quarter, 0.0),
            link(0.0, 0.25),
            link(0.0, 0.25),
            link(quarter, 0.0),
            link(-quarter, 0.0),
        ];
        Arm::new(links, Isometry3::identity(), [0.0; 3]).unwrap()
    }

    fn bent() -> JointVector {
        JointVector::from([0.0, -0.8, 1.6, -0.8, 0.5, 0.0])
    }

    fn after(way: [f64; 3]) -> Result<ContactPosture, OutOfReach> {
        ContactPosture::after(&arm(), &bent(), &Vector3::from(way), &JointVector::repeat(0.05))
    }

    #[test]
    fn straight_way_keeps_the_orientation() {
        let (arm, way) = (arm(), Vector3::new(0.05, 0.02, 0.01));
        let found = after(way.into()).unwrap();
        let (from, to) = (arm.forward(&bent()), arm.forward(&found.q));
        assert!((to.translation.vector - from.translation.vector - way).norm() < 1e-6);
        assert!(from.rotation.angle_to(&to.rotation) < 1e-6);
    }

    #[test]
    fn friction_counts_more_at_a_stretched_elbow() {
        let near = after([0.02, 0.0, 0.0]).unwrap();
        let far = after([0.14, 0.0, 0.0]).unwrap();
        assert!(far.sigma_min < 0.5 * near.sigma_min, "{near:?} {far:?}");
        assert!(far.friction_n > 1.5 * near.friction_n, "{near:?} {far:?}");
    }

    #[test]
    fn friction_is_the_power_of_the_joints_along_the_push() {
        let (arm, coulomb) = (arm(), JointVector::from([0.01, 0.02, 0.03, 0.04, 0.05, 0.06]));
        let way = Vector3::new(0.03, 0.0, 0.0);
        let found = ContactPosture::after(&arm, &bent(), &way, &coulomb).unwrap();
        // Joint rates at a grip speed of 1 m/s along the push.
        let small = 1e-5;
        let on = ContactPosture::after(&arm, &found.q, &Vector3::new(small, 0.0, 0.0), &coulomb);
        let power = (on.unwrap().q - found.q).abs().dot(&coulomb) / small;
        assert!((found.friction_n / power - 1.0).abs() < 1e-2, "{found:?}, {power} N");
    }

    #[test]
    fn way_beyond_the_reach_is_refused() {
        assert!(matches!(after([0.4, 0.0, 0.0]), Err(OutOfReach::NoPosture { .. })));
        let nowhere = after([f64::NAN, 0.0, 0.0]);
        assert!(nowhere.is_err(), "{nowhere:?}");
    }

    #[test]
    fn way_from_a_singular_start_says_so() {
        let stretched = JointVector::from([0.0, -0.8, 0.0, 0.0, 0.5, 0.0]);
        let way = Vector3::new(0.05, 0.0, 0.0);
        let found = ContactPosture::after(&arm(), &stretched, &way, &JointVector::zeros());
        let error = found.unwrap_err();
        assert!(
            matches!(error, OutOfReach::AtStart { sigma_min } if sigma_min < 1e-3),
            "{error:?}"
        );
        assert!(error.to_string().contains("starts in a singular posture"), "{error}");
    }

    #[test]
    fn joint_that_leaves_its_range_is_named() {
        let error = ContactPosture::after(
            &arm(),
            &JointVector::from([0.0, 0.5, 2.9, -2.5, 0.5, 0.0]),
            &Vector3::new(0.0, 0.0, 0.1),
            &JointVector::zeros(),
        );
        assert_eq!(error, Err(OutOfReach::JointRange { joint: 3 }));
    }
}
