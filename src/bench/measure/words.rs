//! What a person is asked for, and is told of the answer.

use nalgebra::{Matrix3x6, Vector3};

use crate::direction::{Answer, Axis, Motion};
use crate::sign::{self, Resistance, Verdict};
use config::{Config, JointParameters};
use controller::JointVector;
use controller::arm::JointKind;
use controller::breakaway::Breakaway;
use telemetry::trial_status::{TrialAnswer, TrialReport};
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

/// Unit of torques of a joint.
const fn unit(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "N·m",
        JointKind::Prismatic => "N",
    }
}

/// Returns what a trial of a drive will do.
pub(crate) fn push(
    parameters: &JointParameters,
    joint: Joint,
    breakaway: &Breakaway,
    bound: u16,
) -> String {
    let (name, unit) = (&parameters.name, unit(parameters.plant.link.kind));
    let share = f64::from(bound) / 1e3;
    let (most, moved) = (breakaway.capacity * share, moved_by(parameters));
    format!(
        "joint {joint} ({name}): its drive pushes both ways, with at most {most:.2} {unit} ({:.1} % of its capacity), until it has \
         moved by {moved}. Hold the deadman.",
        share * 1e2
    )
}

const fn moved_by(parameters: &JointParameters) -> &'static str {
    match parameters.plant.link.kind {
        JointKind::Revolute => "0.3°",
        JointKind::Prismatic => "0.5 mm",
    }
}

/// Returns what a trial has led to.
pub(crate) fn answers(parameters: &JointParameters, report: &TrialReport) -> String {
    let kind = parameters.plant.link.kind;
    let one = |answer: &TrialAnswer| {
        if answer.counts == 0 {
            return "no motion".to_owned();
        }
        let (torque, by) = (sign::torque(parameters, answer), sign::motion(parameters, answer));
        let by = match kind {
            JointKind::Revolute => format!("{:+.2}°", by.to_degrees()),
            JointKind::Prismatic => format!("{:+.2} mm", by * 1e3),
        };
        format!("{torque:+.2} {} moved it by {by}", unit(kind))
    };
    let all: Vec<_> = report.answers.iter().flatten().map(one).collect();
    if all.iter().all(|answer| answer == "no motion") {
        return "  no motion".to_owned();
    }
    format!("  {}", all.join(", "))
}

/// Returns which key is wrong.
pub(crate) fn wrong_sign(config: &Config, joint: Joint, verdict: Verdict) -> String {
    let parameters = joint.entry(&config.joints);
    let (file, name) = (config.file.display(), &parameters.name);
    let reason = match verdict {
        Verdict::OtherTorque { what, found, described: [least, most] } => {
            let unit = unit(parameters.plant.link.kind);
            let masses = match what {
                Resistance::Weight => "mass_kg and centre_of_mass_m of the links beyond",
                Resistance::Friction => "its coulomb_friction",
            };
            format!(
                "{found:.3} {unit} overcomes its {what}, where {least:.3} to {most:.3} {unit} are described: gear_ratio, \
                 rated_torque_nm or torque_curve, {masses}, or node_id"
            )
        }
        Verdict::Reversed | Verdict::Right | Verdict::Unclear => {
            "a positive torque (6071h) lowers its position (6064h): correct the drive's motor phases, encoder or polarity \
             (607Eh) with the maker's tool; drive_polarity states what the boot compares"
                .to_owned()
        }
    };
    format!("{file}: joint {joint} ({name}), node {}: {reason}", parameters.node.raw())
}

/// Returns why nothing is proven.
pub(crate) fn not_proven(config: &Config, joint: Joint, breakaway: &Breakaway) -> String {
    let parameters = joint.entry(&config.joints);
    let (name, unit) = (&parameters.name, unit(parameters.plant.link.kind));
    format!(
        "joint {joint} ({name}): not proven: it does not move with {:.2} {unit}, 1.6 times its weight (with centres \
         of mass off by 2 cm) and 4 times its friction, as described: is its brake on, does something hold it, or is gear_ratio, rated_torque_nm, torque_curve, mass_kg or \
         coulomb_friction wrong?",
        breakaway.most()
    )
}

/// Returns why a trial has ended before its time.
pub(crate) fn aborted(config: &Config, joint: Joint, report: &TrialReport) -> String {
    let name = &joint.entry(&config.joints).name;
    let other = report.moved_instead.and_then(Joint::new);
    let reason = match report.end.as_deref() {
        Some("too-far") => "not proven: it moved by more than 2° (3.5 mm)".to_owned(),
        Some("too-fast") => "not proven: it moved faster than 0.6 rad/s (0.1 m/s)".to_owned(),
        Some("limit-refused") => "not tried: its drive refuses the reduced torque limit".to_owned(),
        Some("not-enabled") => {
            "not tried: its drive is not enabled in time, or another one stays on".to_owned()
        }
        _ => match other {
            Some(other) => {
                let other_name = &other.entry(&config.joints).name;
                format!(
                    "{}: joint {other} ({other_name}) moved: node_id or encoder of one is the other's, or a hand was on the arm",
                    config.file.display()
                )
            }
            None => "ended for an unknown reason".to_owned(),
        },
    };
    format!("joint {joint} ({name}): {reason}")
}

/// Returns which key is wrong when a person has seen another joint move.
pub(crate) fn moved_instead(config: &Config, joint: Joint, seen: &str) -> String {
    let parameters = joint.entry(&config.joints);
    let (file, name, node) = (config.file.display(), &parameters.name, parameters.node.raw());
    let other = config.joints.iter().find(|other| other.name == seen);
    let other = match other {
        Some(other) => format!(
            "those of \"{name}\" ({node}) and \"{seen}\" ({}) may be swapped",
            other.node.raw()
        ),
        None => format!("node {node} drives \"{seen}\""),
    };
    format!("{file}: joint {joint} ({name}): {seen} moved instead: node_id is wrong: {other}")
}
