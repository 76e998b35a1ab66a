//! What a person is asked for, and is told of the answer.

use nalgebra::{Matrix3x6, Vector3};

use crate::direction::{Answer, Axis, Motion};
use config::Config;
use controller::JointVector;
use controller::arm::JointKind;
use units::numbering::Joint;

/// Shortest way of the grip for a turn of a joint, in m per rad, by which its direction is named.
const LEVER: f64 = 0.05;

/// Returns the words for a motion from positions `q`, in rad or m.
pub(crate) fn question(config: &Config, motion: Motion, q: &JointVector) -> String {
    let gravity = Vector3::from(config.gravity);
    match motion {
        Motion::Joint(joint) => {
            let name = &joint.entry(&config.joints).name;
            format!("Move joint {joint} ({name}) alone, {}.", way(config, joint, q))
        }
        Motion::Push(axis) => format!("Push the grip 5 cm {}.", axis.in_words(&gravity)),
        Motion::Turn(axis) => {
            format!(
                "Turn the grip 15° about {axis} of {{0}}: right thumb along {axis}, as the fingers bend."
            )
        }
    }
}

/// Returns where the grip goes, or how it turns, when the position of a joint grows.
fn way(config: &Config, joint: Joint, q: &JointVector) -> String {
    let arm = &config.controller.arm;
    let posture = arm.posture(q);
    let j_g = arm.jacobian(&posture);
    let column =
        |part: &Matrix3x6<f64>| posture.x_0_g.rotation * Vector3::from(part.column(joint.index()));
    let [linear, angular] = [column(&j_g.linear), column(&j_g.angular)];
    let is_sliding = joint.entry(&config.joints).plant.link.kind == JointKind::Prismatic;
    if is_sliding || linear.norm() >= LEVER {
        let by = if is_sliding { "2 cm" } else { "5°" };
        let axis = Axis::nearest(&linear);
        format!("by {by}, so that the grip goes {}", axis.in_words(&config.gravity.into()))
    } else {
        let axis = Axis::nearest(&angular);
        format!("by 5° about {axis} of {{0}}: right thumb along {axis}, as the fingers bend")
    }
}

/// Returns what a motion was, in words.
pub(crate) fn found(config: &Config, answer: Answer) -> String {
    match answer {
        Answer::Right => "right".to_owned(),
        Answer::Reversed => "the position fell where it should grow".to_owned(),
        Answer::OtherJoint(joint) => {
            format!("joint {joint} ({}) moved instead", joint.entry(&config.joints).name)
        }
        Answer::OtherAxis(axis) => format!("by the configuration it was {axis}"),
        Answer::Unclear => "more than that moved, or another way in between".to_owned(),
    }
}

/// Returns which key is wrong.
pub(crate) fn wrong(config: &Config, motion: Motion, answer: Answer) -> String {
    let file = config.file.display();
    let key = match (motion, answer) {
        (Motion::Joint(joint), Answer::OtherJoint(other)) => {
            let [one, two] = [joint, other].map(|joint| joint.entry(&config.joints));
            format!(
                "node_id of \"{}\" ({}) and \"{}\" ({}) are swapped",
                one.name,
                one.node.raw(),
                two.name,
                two.node.raw()
            )
        }
        (Motion::Joint(joint), _) => {
            format!("the sign of gear_ratio (or encoder_counts_per_rev) of \"{}\"", joint.entry(&config.joints).name)
        }
        (Motion::Push(_) | Motion::Turn(_), _) => {
            "the base stands otherwise than {0} of the kinematics, or theta_deg or the zero of a joint before the grip is wrong"
                .to_owned()
        }
    };
    format!("{file}: {}: {}, twice: {key}", motion.name(), found(config, answer))
}
