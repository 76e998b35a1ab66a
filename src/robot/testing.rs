//! Arms and strategies for the tests of this crate.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Isometry3;
use proptest::prelude::*;

use crate::chain::{Chain, Joints, Link};
use crate::damped_inverse::DampedInverse;
use crate::joint_limits::{JointLimit, JointLimits};
use crate::resolved_rate::ResolvedRate;

/// Returns the kinematics of a PUMA 560 (Corke and Armstrong-Hélouvry 1994), with a tool of 12 cm.
pub(crate) fn puma() -> Chain {
    let link = |alpha: f64, a: f64, d: f64| Link { alpha, a, d, theta: 0.0 };
    let links = [
        link(0.0, 0.0, 0.67183),
        link(FRAC_PI_2, 0.0, 0.0),
        link(0.0, 0.4318, 0.15005),
        link(-FRAC_PI_2, 0.0203, 0.4318),
        link(FRAC_PI_2, 0.0, 0.0),
        link(-FRAC_PI_2, 0.0, 0.0),
    ];
    Chain::new(Isometry3::identity(), &links, Isometry3::translation(0.0, 0.0, 0.12)).unwrap()
}

/// Returns an invented redundant arm with eight joints, four of them in its wrist.
pub(crate) fn eight_r() -> Chain {
    let link = |alpha: f64, a: f64, d: f64| Link { alpha, a, d, theta: 0.0 };
    let links = [
        link(0.0, 0.0, 0.35),
        link(-FRAC_PI_2, 0.0, 0.0),
        link(FRAC_PI_2, 0.0, 0.45),
        link(-FRAC_PI_2, 0.05, 0.0),
        link(FRAC_PI_2, -0.05, 0.40),
        link(-FRAC_PI_2, 0.0, 0.0),
        link(FRAC_PI_2, 0.0, 0.0),
        link(-FRAC_PI_2, 0.08, 0.0),
    ];
    Chain::new(Isometry3::identity(), &links, Isometry3::translation(0.0, 0.0, 0.12)).unwrap()
}

/// Returns a posture away from singularities and limits.
pub(crate) fn posture(joint_count: usize) -> Joints {
    if joint_count == 6 {
        Joints::from([0.1, 0.6, -1.9, 0.2, 0.9, 0.1, 0.0, 0.0, 0.0])
    } else {
        Joints::from([0.1, 0.5, 0.3, 1.2, 0.2, -0.8, 0.6, 0.9, 0.0])
    }
}

/// Returns wide limits of each joint.
pub(crate) fn limits(joint_count: usize) -> impl Iterator<Item = JointLimit> {
    let limit = JointLimit { range: [-2.8, 2.8], max_rate: 2.0, max_acceleration: 20.0 };
    (0..joint_count).map(move |_| limit)
}

/// Returns joint values within ±`size`.
pub(crate) fn joints(size: f64) -> impl Strategy<Value = Joints> {
    prop::array::uniform9(-size..size).prop_map(Joints::from)
}

/// Returns a law limited by `max_acceleration`, in rad/s², and a maximum rate of 50 rad/s.
pub(crate) fn law(chain: Chain, max_acceleration: f64) -> ResolvedRate {
    let limit = JointLimit { range: [-2.8, 2.8], max_rate: 50.0, max_acceleration };
    let limits = JointLimits::new((0..chain.joint_count()).map(|_| limit));
    ResolvedRate::new(chain, DampedInverse::default(), limits, 0.5).unwrap()
}
