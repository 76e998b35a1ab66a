//! Position limits of the joints.
//!
//! Soft stops turn a joint back before its limit. A joint may also rest on its mechanical stop, which yields a little,
//! so the limits have a margin. A joint beyond the margin has lost its stop or its zero.

use crate::cause::Cause;
use crate::joint_reading::JointReading;
use controller::JointVector;
use controller::arm::JointKind;
use units::numbering::Joint;

/// Limits of all joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Lower and upper limit with margin, in rad or m.
    ranges: [[f64; 2]; 6],
    kinds: [JointKind; 6],
}

impl Limits {
    /// Widens `ranges` by `margins`, in rad or m.
    pub(super) fn new(ranges: [[f64; 2]; 6], margins: [f64; 6], kinds: [JointKind; 6]) -> Self {
        let mut wider = ranges;
        for ([low, high], margin) in wider.iter_mut().zip(margins) {
            *low -= margin;
            *high += margin;
        }
        Self { ranges: wider, kinds }
    }

    /// Checks the positions of joints with a known zero, in rad or m. NaN is beyond the limit.
    pub(super) fn check(&self, q: &JointVector, known: &[bool; 6]) -> Option<Cause> {
        let mut joints = Joint::each(q.iter().zip(self.ranges));
        let is_beyond = |joint: Joint, q: &f64, [low, high]: [f64; 2]| {
            *joint.entry(known) && !(low..=high).contains(q)
        };
        let (joint, (q, [low, high])) =
            joints.find(|(joint, (q, range))| is_beyond(*joint, q, *range))?;
        let of = |position| JointReading::new(position, *joint.entry(&self.kinds));
        let limit = if *q < low { low } else { high };
        Some(Cause::BeyondLimit { joint, position: of(*q), limit: of(limit) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cause::CauseKind;

    #[test]
    fn message_has_value_limit_and_keys() {
        let mut kinds = [JointKind::Revolute; 6];
        kinds[2] = JointKind::Prismatic;
        let limits = Limits::new([[-1.0, 2.0]; 6], [0.0; 6], kinds);
        let text = |place: usize, position: f64| {
            let mut q = JointVector::from([0.0; 6]);
            q[place] = position;
            limits.check(&q, &[true; 6]).unwrap().with_name(&["", "pitch", "slide", "", "", ""])
        };
        let keys = "check zero_counts, gear_ratio (and its sign) and limit";
        assert_eq!(
            text(1, 2.5),
            format!(
                "joint 2 (pitch): at 143.2°, beyond its limit of 114.6°: {keys}_deg of the joint"
            )
        );
        assert_eq!(
            text(2, -1.5),
            format!(
                "joint 3 (slide): at -1.500 m, beyond its limit of -1.000 m: {keys}_m of the joint"
            )
        );
    }

    #[test]
    fn hazard_43_joint_beyond_its_stop_is_a_fault_one_on_it_is_not() {
        let limits = Limits::new([[-1.0, 2.0]; 6], [0.02; 6], [JointKind::Revolute; 6]);
        let check = |q| limits.check(&JointVector::from([0.0, 0.0, 0.0, 0.0, 0.0, q]), &[true; 6]);
        for q in [-1.019, 0.0, 2.019] {
            assert_eq!(check(q), None);
        }
        for q in [-1.021, 2.021, f64::NAN, f64::INFINITY] {
            let beyond = check(q).unwrap();
            let q = JointVector::from([0.0, 0.0, 0.0, 0.0, 0.0, q]);
            assert_eq!(limits.check(&q, &[true, true, true, true, true, false]), None);
            assert_eq!(
                (beyond.kind(), beyond.joint()),
                (CauseKind::BeyondLimit, Some(Joint::of::<6>())),
                "{q}"
            );
        }
    }
}
