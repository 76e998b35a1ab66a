//! Serial chain of six to nine revolute joints: forward kinematics, and the body Jacobian of the frame under control
//! {MRF}. Frames are Craig's modified Denavit-Hartenberg frames (Craig 1989, 3.4).
//!
//! All numbers of joints share one type: [`Joints`] has nine entries, and absent joints have zero columns in the
//! Jacobian. The chain has no masses, since rates command the robot; `controller` has the chain of the hand
//! controller.

use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

use units::spatial::{Jacobian, Twist};

/// Minimum number of joints, for six degrees of freedom of {MRF}.
pub const MIN_JOINTS: usize = 6;

/// Maximum number of joints.
pub const MAX_JOINTS: usize = 9;

/// Maximum magnitude of a length in m or an angle in rad.
const MAX_MAGNITUDE: f64 = 1e3;

/// One value per joint, base first; zero for absent joints.
pub type Joints = SVector<f64, MAX_JOINTS>;

/// Description of a joint and its link; [`Chain::new`] checks it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// Link twist α of the preceding link, in rad.
    pub alpha: f64,
    /// Link length a of the preceding link, in m.
    pub a: f64,
    /// Joint offset d, in m.
    pub d: f64,
    /// Joint angle θ at joint position zero, in rad.
    pub theta: f64,
}

/// Reason why a chain is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidChain {
    /// Too few or too many joints.
    #[error("an arm must have {MIN_JOINTS} to {MAX_JOINTS} joints, got {0}")]
    JointCount(usize),
    /// Length or angle out of range, or NaN.
    #[error("joint {joint}: {quantity} must be within ±{MAX_MAGNITUDE}, got {value}")]
    Link {
        /// Joint number, from 1.
        joint: usize,
        /// `alpha`, `a`, `d` or `theta`.
        quantity: &'static str,
        /// Rejected value, in rad or m.
        value: f64,
    },
    /// Pose of base or tool is not finite.
    #[error("{0} must be finite")]
    Pose(&'static str),
}

/// Serial chain from its base in {b} to {MRF}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    x_b_0: Isometry3<f64>,
    links: [Option<LinkTransform>; MAX_JOINTS],
    joint_count: usize,
    x_n_m: Isometry3<f64>,
}

/// Link with its constant transform precomputed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LinkTransform {
    /// `Rx(α) Tx(a) Tz(d)`: a translation along z commutes with a rotation about it.
    fixed: Isometry3<f64>,
    theta: f64,
}

impl Chain {
    /// Creates a chain with the pose of its base in {b}, `x_b_0`, and that of {MRF} in its last link, `x_n_m`.
    ///
    /// # Errors
    /// Returns an error for a number of joints outside 6 to 9, or the first value out of range.
    pub fn new(
        x_b_0: Isometry3<f64>,
        links: &[Link],
        x_n_m: Isometry3<f64>,
    ) -> Result<Self, InvalidChain> {
        if !(MIN_JOINTS..=MAX_JOINTS).contains(&links.len()) {
            return Err(InvalidChain::JointCount(links.len()));
        }
        for (joint, link) in (1..).zip(links) {
            link.check(joint)?;
        }
        for (name, pose) in [("the pose of the base", &x_b_0), ("the pose of the tool", &x_n_m)] {
            if !is_finite(pose) {
                return Err(InvalidChain::Pose(name));
            }
        }
        let mut transforms = [None; MAX_JOINTS];
        for (transform, link) in transforms.iter_mut().zip(links) {
            *transform = Some(link.transform());
        }
        Ok(Self { x_b_0, links: transforms, joint_count: links.len(), x_n_m })
    }

    /// Returns the number of joints, 6 to 9.
    pub const fn joint_count(&self) -> usize {
        self.joint_count
    }

    /// Computes the pose of {MRF} in {b} at joint positions `q` in rad.
    pub fn forward(&self, q: &Joints) -> Isometry3<f64> {
        let links = self.links.iter().flatten().zip(q);
        links.fold(self.x_b_0, |x_b_i, (link, q)| x_b_i * link.step(*q)) * self.x_n_m
    }

    /// Returns the poses of the joints' links in {b} at joint positions `q` in rad; `None` for joints that the arm does not have.
    pub fn links(&self, q: &Joints) -> [Option<Isometry3<f64>>; MAX_JOINTS] {
        let mut x_b_i = self.x_b_0;
        let mut poses = [None; MAX_JOINTS];
        for ((pose, link), q) in poses.iter_mut().zip(self.links.iter().flatten()).zip(q) {
            x_b_i *= link.step(*q);
            *pose = Some(x_b_i);
        }
        poses
    }

    /// Computes the pose of {MRF} in {b} and its body Jacobian, `v_m = J qd`, written in {MRF}.
    pub fn forward_and_jacobian(&self, q: &Joints) -> (Isometry3<f64>, Jacobian<MAX_JOINTS>) {
        let links = self.links(q);
        let x_b_n = links.iter().flatten().last().unwrap_or(&self.x_b_0);
        let x_b_m = x_b_n * self.x_n_m;
        let r_m_b = x_b_m.rotation.inverse();
        let columns = links.map(|link| {
            link.map_or(Twist::ZERO, |x_b_i| {
                let (z_b, p_b) = (x_b_i.rotation * Vector3::z(), x_b_i.translation.vector);
                Twist {
                    linear: r_m_b * z_b.cross(&(x_b_m.translation.vector - p_b)),
                    angular: r_m_b * z_b,
                }
            })
        });
        (x_b_m, Jacobian::from_columns(&columns))
    }
}

impl Link {
    fn check(&self, joint: usize) -> Result<(), InvalidChain> {
        let Self { alpha, a, d, theta } = *self;
        for (quantity, value) in [("alpha", alpha), ("a", a), ("d", d), ("theta", theta)] {
            if !(-MAX_MAGNITUDE..=MAX_MAGNITUDE).contains(&value) {
                return Err(InvalidChain::Link { joint, quantity, value });
            }
        }
        Ok(())
    }

    fn transform(&self) -> LinkTransform {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.alpha);
        let along_z = turned * Vector3::new(0.0, 0.0, self.d);
        let place = Translation3::from(Vector3::new(self.a, 0.0, 0.0) + along_z);
        LinkTransform { fixed: Isometry3::from_parts(place, turned), theta: self.theta }
    }
}

impl LinkTransform {
    /// Returns the pose of this link in the preceding one, at joint position `q` in rad.
    fn step(&self, q: f64) -> Isometry3<f64> {
        self.fixed * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.theta + q)
    }
}

fn is_finite(x: &Isometry3<f64>) -> bool {
    x.translation.vector.iter().chain(x.rotation.coords.iter()).all(|part| part.is_finite())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use proptest::prelude::*;

    use super::*;
    use crate::testing::{eight_r, joints, puma};

    proptest! {
        #[test]
        fn jacobian_is_the_derivative_of_the_pose(q in joints(2.5), qd in joints(1.0)) {
            for chain in [puma(), eight_r()] {
                let step = 1e-6;
                let before = chain.forward(&(q - qd * step));
                let after = chain.forward(&(q + qd * step));
                let moved = Twist::reaching(&(before.inverse() * after), 2.0 * step);
                let expected = chain.forward_and_jacobian(&q).1.twist(&qd);
                for (a, b) in moved.components().iter().zip(expected.components()) {
                    prop_assert!((a - b).abs() < 1e-7, "{moved:?} {expected:?}");
                }
            }
        }

        #[test]
        fn absent_joints_change_nothing(q in joints(2.5), extra in -3.0..3.0_f64) {
            let mut other = q;
            other[8] += extra;
            for chain in [puma(), eight_r()] {
                let (x, j) = chain.forward_and_jacobian(&q);
                prop_assert_eq!((x, j), chain.forward_and_jacobian(&other));
                prop_assert_eq!(x, chain.forward(&q));
            }
        }
    }

    #[test]
    fn straight_chain_reaches_the_sum_of_its_links() {
        let links = [Link { a: 0.1, ..Link::default() }; 7];
        let tool = Isometry3::translation(0.0, 0.0, 0.2);
        let chain = Chain::new(Isometry3::translation(0.0, 0.0, 1.0), &links, tool).unwrap();
        let straight = chain.forward(&Joints::zeros()).translation.vector;
        assert!((straight - Vector3::new(0.7, 0.0, 1.2)).norm() < 1e-12);
        let mut q = Joints::zeros();
        q[0] = FRAC_PI_2;
        let turned = chain.forward(&q).translation.vector;
        assert!((turned - Vector3::new(0.1, 0.6, 1.2)).norm() < 1e-12, "{turned}");
    }

    #[test]
    fn invalid_chains_are_refused() {
        let link = Link::default();
        let new = |links: &[Link]| Chain::new(Isometry3::identity(), links, Isometry3::identity());
        assert_eq!(new(&[link; 5]), Err(InvalidChain::JointCount(5)));
        assert_eq!(new(&[link; 10]), Err(InvalidChain::JointCount(10)));
        let wrong = Link { d: f64::NAN, ..link };
        let error = new(&[link, wrong, link, link, link, link]).unwrap_err();
        assert!(error.to_string().starts_with("joint 2: d must be"), "{error}");
        let far = Isometry3::translation(f64::INFINITY, 0.0, 0.0);
        assert!(Chain::new(far, &[link; 6], Isometry3::identity()).is_err());
    }
}
