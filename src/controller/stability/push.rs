//! Equivalent force of joint torques on a hand, by the speed that they give it.
//!
//! A force F accelerates a free hand of mass m to the speed F t / m in a short time t. Joint torques τ accelerate it
//! to `t J (M + m JᵀJ)⁻¹ τ`: J is the translational Jacobian of the grip, M the arm's mass matrix. The equivalent
//! force is `F = m |J (M + m JᵀJ)⁻¹ τ|`. Unlike `J⁻ᵀ τ` it is bounded at singularities, where the structure carries
//! the torque.
//!
//! Each result is the maximum over `postures`, a sample of the joint ranges.

use nalgebra::{SMatrix, SVector};

use crate::JointVector;
use crate::arm::Arm;
use crate::coupling::Coupling;
use crate::soft_stops::SoftStops;

/// Arm with a hand at its grip.
#[derive(Clone, Copy, Debug)]
pub struct PushedHand<'a> {
    /// Kinematics and masses of the arm.
    pub arm: &'a Arm<6>,
    /// Coupling of actuators and joints.
    pub coupling: &'a Coupling<6>,
    /// Mass of hand and grip, in kg.
    pub mass: f64,
}

impl PushedHand<'_> {
    /// Returns the maximum force in N of actuator torques of any sign, each up to `most` in N·m or N.
    pub fn by_actuators(&self, most: &JointVector) -> f64 {
        self.largest(|_, forces| {
            let shares = joint_shares(self.coupling, most);
            let pushes: Vec<SVector<f64, 3>> = shares.map(|share| forces * share).collect();
            // The norm is the same with all signs reversed, so the first is fixed.
            (0..1_u32 << 5).map(|signs| sum(&pushes, signs).norm()).fold(0.0, f64::max)
        })
    }

    /// Returns the maximum force in N of the soft stops, with joints at the ends of their ranges.
    pub fn by_soft_stops(&self, stops: &SoftStops<6>) -> f64 {
        self.largest(|q, forces| (forces * stops.torques(q, &JointVector::zeros())).norm())
    }

    /// Returns the maximum of `push` over the postures. Its arguments are joint positions and the matrix from joint torques
    /// to forces.
    fn largest(&self, push: impl Fn(&JointVector, &SMatrix<f64, 3, 6>) -> f64) -> f64 {
        let pushes = postures(&self.arm.ranges()).into_iter().filter_map(|q| {
            let posture = self.arm.posture(&q);
            let j = self.arm.jacobian(&posture).linear;
            let mass = self.arm.mass_matrix(&posture) + j.tr_mul(&j) * self.mass;
            Some(push(&q, &(j * mass.cholesky()?.inverse() * self.mass)))
        });
        pushes.fold(0.0, f64::max)
    }
}

/// Returns the joint torques of each actuator alone at its `most`.
fn joint_shares<'a>(
    coupling: &'a Coupling<6>,
    most: &'a JointVector,
) -> impl Iterator<Item = JointVector> + 'a {
    most.iter().enumerate().map(|(place, most)| {
        coupling
            .at_joints(&JointVector::from_fn(|joint, _| if joint == place { *most } else { 0.0 }))
    })
}

/// Sums `pushes`; bit `i` of `signs` reverses push `i + 1`.
fn sum(pushes: &[SVector<f64, 3>], signs: u32) -> SVector<f64, 3> {
    let signed = pushes.iter().enumerate().map(|(place, push)| {
        let is_turned = place > 0 && signs >> (place - 1) & 1 == 1;
        if is_turned { -push } else { *push }
    });
    signed.sum()
}

/// Returns all combinations of range ends, each joint alone at an end with the others in mid-range, and mid-range.
fn postures(ranges: &[[f64; 2]; 6]) -> Vec<JointVector> {
    let middle = JointVector::from(ranges.map(|[low, high]| f64::midpoint(low, high)));
    let corner = |ends: u32| {
        let at = |(place, [low, high]): (usize, &[f64; 2])| {
            if ends >> place & 1 == 1 { *high } else { *low }
        };
        JointVector::from_iterator(ranges.iter().enumerate().map(at))
    };
    let alone = ranges.iter().enumerate().flat_map(|(place, ends)| {
        ends.map(|end| {
            let joint = |(other, middle): (usize, &f64)| if other == place { end } else { *middle };
            JointVector::from_iterator(middle.iter().enumerate().map(joint))
        })
    });
    (0..1 << 6).map(corner).chain(alone).chain([middle]).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::arm::Link;

    /// Returns an arm with one joint 0.5 m from the grip, and five that turn the grip in place.
    fn arm() -> Arm<6> {
        let link = Link { rotor_inertia: 1e-3, range: [-1.0, 1.0], ..Link::TURNING };
        let mut links = [link; 6];
        links[1].a = 0.5;
        Arm::new(links, Isometry3::identity(), [0.0; 3]).unwrap()
    }

    const RANGES: [[f64; 2]; 6] =
        [[-1.0, 2.0], [-0.5, 0.25], [0.5, 1.5], [-3.0, -1.0], [-2.0, 1.0], [0.0, 4.0]];

    #[test]
    fn postures_are_all_corners_each_end_alone_and_the_middle() {
        let postures = postures(&RANGES);
        let count = |q: JointVector| postures.iter().filter(|other| **other == q).count();
        for corner in 0..64_usize {
            let end = |joint: usize| RANGES[joint][(corner >> joint) % 2];
            assert_eq!(count(JointVector::from_fn(|joint, _| end(joint))), 1, "{corner}");
        }
        let middle = JointVector::from([0.5, -0.125, 1.0, -2.0, -0.5, 2.0]);
        assert_eq!(count(middle), 1);
        for (joint, ends) in RANGES.into_iter().enumerate() {
            for end in ends {
                let mut alone = middle;
                alone[joint] = end;
                assert_eq!(count(alone), 1, "joint {joint} at {end}");
            }
        }
        assert_eq!(postures.len(), 64 + 12 + 1);
    }

    #[test]
    fn largest_push_is_found_at_any_corner() {
        let links = RANGES.map(|range| Link { rotor_inertia: 1e-3, range, ..Link::TURNING });
        let arm = Arm::new(links, Isometry3::identity(), [0.0; 3]).unwrap();
        let hand = PushedHand { arm: &arm, coupling: &Coupling::none(), mass: 1.0 };
        for corner in postures(&RANGES) {
            let largest = hand.largest(|q, _| if *q == corner { 3.0 } else { 1.0 });
            assert!(largest > 2.0, "{corner}");
        }
    }

    #[test]
    fn largest_push_is_of_all_signs_but_that_of_the_first() {
        let pushes = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0].map(|push| SVector::from([push, 0.0, 0.0]));
        let mut sums: Vec<f64> = (0..32).map(|signs| sum(&pushes, signs).x).collect();
        sums.sort_by(f64::total_cmp);
        let expected: Vec<f64> = (0..32).map(|place| 4.0 * f64::from(place) - 61.0).collect();
        assert_eq!(sums, expected, "the odd sums, with +1 of the first");
    }

    #[test]
    fn actuators_push_most_with_the_signs_that_agree() {
        // All joints turn the grip about one axis, at a lever of 0.5 m.
        let link = Link { rotor_inertia: 1e-3, range: [-1.0, 1.0], ..Link::TURNING };
        let lever = Isometry3::translation(0.5, 0.0, 0.0);
        let arm = Arm::new([link; 6], lever, [0.0; 3]).unwrap();
        let hand = PushedHand { arm: &arm, coupling: &Coupling::none(), mass: 1.0 };
        for joint in 1..6 {
            let mut most = JointVector::from([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            let one = hand.by_actuators(&most);
            most[joint] = 2.0;
            let both = hand.by_actuators(&most);
            most[joint] = -2.0;
            let opposite = hand.by_actuators(&most);
            assert!((both - 2.0 * one).abs() < 1e-9, "{both} N of joints 1 and {}", joint + 1);
            assert!((opposite - both).abs() < 1e-9, "{opposite} N of joints 1 and {}", joint + 1);
        }
    }

    #[test]
    fn push_of_a_light_arm_is_torque_over_lever() {
        let (arm, coupling) = (arm(), Coupling::none());
        let hand = PushedHand { arm: &arm, coupling: &coupling, mass: 1.0 };
        let most = JointVector::from([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let force = hand.by_actuators(&most);
        assert!((force - 2.0 / 0.5).abs() < 0.05, "{force} N");
        let opposite = hand.by_actuators(&-most);
        assert!((force - opposite).abs() < 1e-9);
    }

    #[test]
    fn push_counts_by_the_share_of_the_hand_in_what_moves() {
        // Torque over lever, reduced by the rotor's share of the inertia: 1e-3 kg·m² against m (0.5 m)².
        let (arm, coupling) = (arm(), Coupling::none());
        let most = JointVector::from([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for mass in [0.02, 0.5, 4.0] {
            let force = PushedHand { arm: &arm, coupling: &coupling, mass }.by_actuators(&most);
            let hand = mass * 0.5 * 0.5;
            let expected = 4.0 * hand / (hand + 1e-3);
            assert!(
                (force / expected - 1.0).abs() < 0.02,
                "{mass} kg: {force} N, not {expected} N"
            );
        }
    }

    #[test]
    fn push_at_a_singularity_is_bounded() {
        let (arm, coupling) = (arm(), Coupling::none());
        let hand = PushedHand { arm: &arm, coupling: &coupling, mass: 1.0 };
        // None of these joints moves the grip.
        let most = JointVector::from([0.0, 5.0, 5.0, 5.0, 5.0, 5.0]);
        assert!(hand.by_actuators(&most) < 1e-9);
    }

    #[test]
    fn soft_stops_push_only_at_an_end() {
        let arm = arm();
        let coupling = Coupling::none();
        let hand = PushedHand { arm: &arm, coupling: &coupling, mass: 1.0 };
        let max = JointVector::from([2.0; 6]);
        let stops = |push| SoftStops::new(arm.ranges(), &max, 0.1, push).unwrap();
        assert!(hand.by_soft_stops(&stops(0.0)) == 0.0);
        let force = hand.by_soft_stops(&stops(0.5));
        assert!((force - 1.0 / 0.5).abs() < 0.05, "{force} N");
    }
}
