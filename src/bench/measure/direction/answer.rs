//! Which motion has been made, by the configuration's positions and kinematics.

use nalgebra::Vector3;

use super::axis::Axis;
use super::motion::Motion;
use super::rest::per_kind;
use controller::JointVector;
use controller::arm::Arm;
use units::numbering::Joint;

/// Motion of a joint that is judged, in rad and m.
const MOVED: [f64; 2] = [5.0_f64.to_radians(), 0.02];

/// Share of that by which other joints may move meanwhile.
const ALONE: f64 = 0.4;

/// Length of a push that is judged, in m.
const PUSHED: f64 = 0.05;

/// Angle of a turn that is judged, in rad.
const TURNED: f64 = 15.0_f64.to_radians();

/// Least cosine of the angle to the axis: 26°.
const ALONG: f64 = 0.9;

/// Motion that has been made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The one that was asked for.
    Right,
    /// The joint in the opposite direction.
    Reversed,
    /// Another joint, and this one not.
    OtherJoint(Joint),
    /// Along or about another axis.
    OtherAxis(Axis),
    /// More joints than one, or along no axis: it says nothing.
    Unclear,
}

impl Answer {
    /// Returns whether it contradicts the configuration.
    pub const fn is_contradiction(self) -> bool {
        match self {
            Self::Reversed | Self::OtherJoint(_) | Self::OtherAxis(_) => true,
            Self::Right | Self::Unclear => false,
        }
    }
}

/// Returns the answer once the motion is large enough.
pub(super) fn of(
    arm: &Arm<6>,
    motion: Motion,
    from: &JointVector,
    q: &JointVector,
) -> Option<Answer> {
    match motion {
        Motion::Joint(joint) => of_joint(arm, joint, &(q - from)),
        Motion::Push(axis) => {
            let [from, to] = [from, q].map(|q| arm.forward(q).translation.vector);
            of_axis(axis, &(to - from), PUSHED)
        }
        Motion::Turn(axis) => {
            let [from, to] = [from, q].map(|q| arm.forward(q).rotation);
            of_axis(axis, &(to * from.inverse()).scaled_axis(), TURNED)
        }
    }
}

fn of_joint(arm: &Arm<6>, asked: Joint, moved: &JointVector) -> Option<Answer> {
    let shares = moved.component_div(&per_kind(&arm.kinds(), MOVED));
    let (most, share) = Joint::each(shares.iter())
        .max_by(|(_, one), (_, other)| one.abs().total_cmp(&other.abs()))?;
    if share.abs() < 1.0 {
        return None;
    }
    let mut others = Joint::each(shares.iter()).filter(|(joint, _)| *joint != most);
    Some(if others.any(|(_, share)| share.abs() > ALONE) {
        Answer::Unclear
    } else if most != asked {
        Answer::OtherJoint(most)
    } else if *share > 0.0 {
        Answer::Right
    } else {
        Answer::Reversed
    })
}

fn of_axis(asked: Axis, moved: &Vector3<f64>, least: f64) -> Option<Answer> {
    let length = moved.norm();
    if length < least {
        return None;
    }
    let nearest = Axis::nearest(moved);
    Some(if nearest.unit().dot(moved) < ALONG * length {
        Answer::Unclear
    } else if nearest == asked {
        Answer::Right
    } else {
        Answer::OtherAxis(nearest)
    })
}
