//! Position limits of the joints.
//!
//! Soft stops turn a joint back before its limit. A joint may also rest on its mechanical stop, which yields a little,
//! so the limits have a margin. A joint beyond the margin has lost its stop or its zero.

use crate::cause::Cause;
use controller::JointVector;
use units::numbering::Joint;

/// Limits of all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Lower and upper limit with margin, in rad or m.
    ranges: [[f64; 2]; 6],
}

impl Limits {
    /// Widens `ranges` by `margins`, in rad or m.
    pub(super) fn new(ranges: [[f64; 2]; 6], margins: [f64; 6]) -> Self {
        let mut wider = ranges;
        for ([low, high], margin) in wider.iter_mut().zip(margins) {
            *low -= margin;
            *high += margin;
        }
        Self { ranges: wider }
    }

    /// Checks joint positions in rad or m. NaN is beyond the limit.
    pub(super) fn check(&self, q: &JointVector) -> Option<Cause> {
        let mut joints = Joint::each(q.iter().zip(self.ranges));
        let (joint, _) = joints.find(|(_, (q, [low, high]))| !(low..=high).contains(q))?;
        Some(Cause::BeyondLimit { joint })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hazard_43_joint_beyond_its_stop_is_a_fault_one_on_it_is_not() {
        let limits = Limits::new([[-1.0, 2.0]; 6], [0.02; 6]);
        let check = |q| limits.check(&JointVector::from([0.0, 0.0, 0.0, 0.0, 0.0, q]));
        for q in [-1.019, 0.0, 2.019] {
            assert_eq!(check(q), None);
        }
        for q in [-1.021, 2.021, f64::NAN, f64::INFINITY] {
            assert_eq!(check(q), Some(Cause::BeyondLimit { joint: Joint::of::<6>() }), "{q}");
        }
    }
}
