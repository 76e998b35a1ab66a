//! Arms for the commanded side: a well-known robot and a redundant one.
//!
//! The hand controllers are configurations (`config/`), not code: every laboratory has its own.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Isometry3;

use crate::arm::{Arm, InvalidArm, Link};

/// On Earth, z pointing up, in m/s².
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// The Unimation PUMA 560 on its pedestal, with the parameters of Corke and Armstrong-Hélouvry (1994)
/// written in modified Denavit-Hartenberg; rotor inertias are `G² J_m`. Joint positions are those of
/// that paper.
///
/// # Errors
/// None: the numbers are fixed.
pub fn puma560() -> Result<Arm<6>, InvalidArm> {
    let degrees = |[low, high]: [f64; 2]| [low.to_radians(), high.to_radians()];
    let links = [
        Link {
            d: 0.671_83,
            inertia: [0.0, 0.0, 0.35, 0.0, 0.0, 0.0],
            rotor_inertia: rotor(-62.6111, 200e-6),
            range: degrees([-160.0, 160.0]),
            ..Link::TURNING
        },
        Link {
            alpha: FRAC_PI_2,
            mass: 17.4,
            centre_of_mass: [0.068, 0.006, 0.2275],
            inertia: [0.13, 0.524, 0.539, 0.0, 0.0, 0.0],
            rotor_inertia: rotor(107.815, 200e-6),
            range: degrees([-45.0, 225.0]),
            ..Link::TURNING
        },
        Link {
            a: 0.4318,
            d: 0.150_05,
            mass: 4.8,
            centre_of_mass: [0.0, 0.07, 0.0141],
            inertia: [0.066, 0.0125, 0.086, 0.0, 0.0, 0.0],
            rotor_inertia: rotor(-53.7063, 200e-6),
            range: degrees([-225.0, 45.0]),
            ..Link::TURNING
        },
        Link {
            alpha: -FRAC_PI_2,
            a: 0.0203,
            d: 0.4318,
            mass: 0.82,
            centre_of_mass: [0.0, 0.0, 0.019],
            inertia: [1.8e-3, 1.8e-3, 1.3e-3, 0.0, 0.0, 0.0],
            rotor_inertia: rotor(76.0364, 33e-6),
            range: degrees([-110.0, 170.0]),
            ..Link::TURNING
        },
        Link {
            alpha: FRAC_PI_2,
            mass: 0.34,
            inertia: [0.3e-3, 0.3e-3, 0.4e-3, 0.0, 0.0, 0.0],
            rotor_inertia: rotor(71.923, 33e-6),
            range: degrees([-100.0, 100.0]),
            ..Link::TURNING
        },
        Link {
            alpha: -FRAC_PI_2,
            mass: 0.09,
            centre_of_mass: [0.0, 0.0, 0.032],
            inertia: [0.15e-3, 0.15e-3, 0.04e-3, 0.0, 0.0, 0.0],
            rotor_inertia: rotor(76.686, 33e-6),
            range: degrees([-266.0, 266.0]),
            ..Link::TURNING
        },
    ];
    Arm::new(links, Isometry3::identity(), GRAVITY)
}

/// A redundant arm of eight turning joints, four of them in the wrist, as the arms were that Williams
/// commanded in rate mode. Invented figures.
///
/// # Errors
/// None: the numbers are fixed.
pub fn eight_r() -> Result<Arm<8>, InvalidArm> {
    let link = |alpha: f64, [a, d]: [f64; 2], mass: f64| {
        let turned = mass * 0.02;
        Link {
            alpha,
            a,
            d,
            mass,
            centre_of_mass: [0.02, -0.01, 0.1],
            inertia: [turned, turned, turned / 2.0, 0.0, 0.0, 0.0],
            rotor_inertia: 0.05,
            ..Link::TURNING
        }
    };
    let links = [
        link(0.0, [0.0, 0.35], 8.0),
        link(-FRAC_PI_2, [0.0, 0.0], 7.0),
        link(FRAC_PI_2, [0.0, 0.45], 5.0),
        link(-FRAC_PI_2, [0.05, 0.0], 4.0),
        link(FRAC_PI_2, [-0.05, 0.40], 2.5),
        link(-FRAC_PI_2, [0.0, 0.0], 1.5),
        link(FRAC_PI_2, [0.0, 0.0], 1.0),
        link(-FRAC_PI_2, [0.08, 0.0], 0.6),
    ];
    Arm::new(links, Isometry3::translation(0.0, 0.0, 0.12), GRAVITY)
}

/// A rotor's inertia in kg·m², seen through its gear.
fn rotor(gear: f64, inertia: f64) -> f64 {
    gear * gear * inertia
}

#[cfg(test)]
mod tests {
    use nalgebra::{SVector, UnitQuaternion, Vector3};
    use proptest::prelude::*;

    use super::*;
    use units::spatial::Twist;

    fn joints() -> impl Strategy<Value = SVector<f64, 8>> {
        prop::array::uniform8(-2.5..2.5_f64).prop_map(SVector::from)
    }

    #[test]
    fn puma_turns_as_far_as_its_makers_say() {
        let published = [
            [-160.0, 160.0],
            [-45.0, 225.0],
            [-225.0, 45.0],
            [-110.0, 170.0],
            [-100.0, 100.0],
            [-266.0, 266.0],
        ];
        for (range, published) in puma560().unwrap().ranges().into_iter().zip(published) {
            for (end, published) in range.into_iter().zip(published) {
                assert!((end.to_degrees() - published).abs() < 1e-9, "{range:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn eight_joints_move_the_grip_as_their_jacobian_says(q in joints(), qd in joints()) {
            let (arm, step) = (eight_r().unwrap(), 1e-6);
            let x = arm.forward(&(q - qd * step)).inverse() * arm.forward(&(q + qd * step));
            let moved = Twist::reaching(&x, 2.0 * step);
            let said = arm.jacobian(&arm.posture(&q)).twist(&qd);
            for (moved, said) in moved.components().iter().zip(said.components()) {
                prop_assert!((moved - said).abs() < 1e-6, "moved {moved}, said {said}");
            }
        }

        #[test]
        fn eight_joints_have_a_mass_whichever_way_they_move(q in joints(), qd in joints()) {
            let arm = eight_r().unwrap();
            let mass = arm.mass_matrix(&arm.posture(&q));
            prop_assert!((mass - mass.transpose()).norm() < 1e-12);
            prop_assert!(qd.dot(&(mass * qd)) >= 0.05 * qd.norm_squared());
        }

        #[test]
        fn a_tilted_base_is_gravity_turned_the_other_way(
            q in joints(), tilt in -3.0..3.0_f64
        ) {
            // An arm whose first joint turns about the tilted axis stands on the base that it tilts.
            let arm = eight_r().unwrap();
            let about_z = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), tilt);
            let mut turned = q;
            turned[0] += tilt;
            let around = arm.gravity(&arm.posture(&turned)) - arm.gravity(&arm.posture(&q));
            prop_assert!(around.norm() < 1e-9, "about the vertical nothing changes");
            // Gravity along x, seen after a turn of the base about z.
            let sideways = |direction: Vector3<f64>| arm.in_gravity((direction * 9.81).into()).unwrap();
            let here = sideways(Vector3::x()).gravity(&arm.posture(&q));
            let there = sideways(about_z * Vector3::x()).gravity(&arm.posture(&turned));
            prop_assert!((here - there).norm() < 1e-9);
        }
    }

    #[test]
    fn the_arms_can_be() {
        assert!(puma560().is_ok() && eight_r().is_ok());
    }
}
