//! Whether every joint is where its end stops let it be.
//!
//! Soft stops turn a joint back before it gets there, and what does get there rests on the mechanical stop,
//! which gives way a little: that is no fault, and so the limits have a margin. A joint beyond it has lost its
//! stop or its zero.

use crate::cause::Cause;
use controller::JointVector;
use units::numbering::Joint;

/// The watch on all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// With the margins, in rad or m.
    ranges: [[f64; 2]; 6],
}

impl Limits {
    /// Of these ranges and the margins around them, in rad or m.
    pub(super) fn new(ranges: [[f64; 2]; 6], margins: [f64; 6]) -> Self {
        let mut wider = ranges;
        for ([low, high], margin) in wider.iter_mut().zip(margins) {
            *low -= margin;
            *high += margin;
        }
        Self { ranges: wider }
    }

    /// Takes joint positions, in rad or m.
    pub(super) fn judge(&self, q: &JointVector) -> Option<Cause> {
        let mut joints = Joint::each(q.iter().zip(self.ranges));
        let (joint, _) = joints.find(|(_, (q, [low, high]))| !(low..=high).contains(q))?;
        Some(Cause::BeyondLimit { joint })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hazard_43_a_joint_beyond_its_stop_is_told_and_one_that_rests_on_it_is_not() {
        let limits = Limits::new([[-1.0, 2.0]; 6], [0.02; 6]);
        let told = |q| limits.judge(&JointVector::from([0.0, 0.0, 0.0, 0.0, 0.0, q]));
        for q in [-1.019, 0.0, 2.019] {
            assert_eq!(told(q), None);
        }
        for q in [-1.021, 2.021, f64::NAN, f64::INFINITY] {
            assert_eq!(told(q), Some(Cause::BeyondLimit { joint: Joint::of::<6>() }), "{q}");
        }
    }
}
