//! What may be trusted of numbers that come from outside.
//!
//! Not their age, nor whether they are plausible for the task. A number that is none is replaced by
//! the harmless one and named as a fault; no later equation checks again.

use nalgebra::Isometry3;

use crate::controller::Fault;
use crate::controller::Input;
use crate::controller::arm::is_pose;
use crate::spatial::Wrench;

/// No sensor reads more, in N or N·m.
const LARGEST_READING: f64 = 1e5;

/// An input whose numbers are numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trusted {
    /// The sensed wrench, or none.
    pub(crate) f_s: Wrench,
    /// The object's pose, or the last one that was one.
    pub(crate) x_b_m: Isometry3<f64>,
    /// 0 to 1.
    pub(crate) gravity_share: f64,
    /// 0 to 1.
    pub(crate) reflection_share: f64,
    /// The worst that was found.
    pub(crate) fault: Option<Fault>,
}

impl Trusted {
    /// Checks an input; `x_b_before` is the object's last good pose.
    pub(crate) fn of(input: &Input, x_b_before: &Isometry3<f64>) -> Self {
        let (f_s, wrench_fault) = match largest(&input.f_s) {
            size if size <= LARGEST_READING => (input.f_s, None),
            size if size.is_finite() => (Wrench::ZERO, Some(Fault::WrenchTooLarge)),
            _ => (Wrench::ZERO, Some(Fault::WrenchNotFinite)),
        };
        let (x_b_m, pose_fault) = if is_pose(&input.x_b_m) {
            (input.x_b_m, None)
        } else {
            (*x_b_before, Some(Fault::ObjectPoseNotFinite))
        };
        let (gravity_share, gravity_fault) = share(input.gravity_share);
        let (reflection_share, reflection_fault) = share(input.reflection_share);
        let fault = wrench_fault.or(pose_fault).or(gravity_fault).or(reflection_fault);
        Self { f_s, x_b_m, gravity_share, reflection_share, fault }
    }
}

/// The largest component, without sign; not a number if one is none.
fn largest(wrench: &Wrench) -> f64 {
    if wrench.is_finite() {
        wrench.components().iter().fold(0.0, |size: f64, part| size.max(part.abs()))
    } else {
        f64::NAN
    }
}

/// A share of 0 to 1; what is no such share is none.
fn share(value: f64) -> (f64, Option<Fault>) {
    if (0.0..=1.0).contains(&value) { (value, None) } else { (0.0, Some(Fault::ShareOutOfRange)) }
}
