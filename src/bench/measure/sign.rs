//! Does a positive torque raise the position? Which bounds a drive is tried with, and what its answers mean.

use derive_more::Display;

use config::{Config, JointParameters};
use controller::JointVector;
use controller::breakaway::Breakaway;
use telemetry::trial_status::{TrialAnswer, TrialReport};
use units::numbering::Joint;

/// Bounds that are tried one after the other, in ‰ of the capacity; the last one is the most that the joint may need.
const BOUNDS: [u16; 4] = [50, 100, 200, 400];

/// Shares of the described weight within which a joint lifts its own.
const WEIGHT: [f64; 2] = [0.5, 1.7];

/// Shares of the described dry friction within which a joint breaks away, both ways.
const FRICTION: [f64; 2] = [0.4, 4.5];

/// Multiple of a small weight with which a push into a soft rest moves the joint.
const YIELDS: f64 = 2.0;

/// What the answers of a drive mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It moves with its torque, by about the torque that the description says.
    Right,
    /// No motion that proves both its direction and its torque; a higher bound may.
    Unclear,
    /// Its position falls with a positive torque, or rises with a negative one.
    Reversed,
    /// It needs another torque than described, in N·m or N.
    OtherTorque {
        /// What needs it.
        what: Resistance,
        /// Torque that it needs.
        found: f64,
        /// Least and most torque by the description.
        described: [f64; 2],
    },
}

/// What a torque overcomes.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Resistance {
    /// The weight, where the joint is lifted.
    #[display("weight")]
    Weight,
    /// The dry friction, where it breaks away both ways.
    #[display("friction")]
    Friction,
}

/// Returns the bounds with which a drive is tried, in ‰ of its capacity; none if it can need no torque.
pub fn bounds(breakaway: &Breakaway) -> Vec<u16> {
    let most = breakaway.most_share();
    let below = BOUNDS.into_iter().filter(|bound| *bound < most);
    below.chain((most > 0).then_some(most)).collect()
}

/// Returns the described breakaway of a joint, with the arm at `q`, in rad or m.
pub fn breakaway(config: &Config, joint: Joint, q: &JointVector) -> Breakaway {
    let controller = &config.controller;
    let (arm, friction) = (&controller.arm, &controller.dry_friction);
    Breakaway::new(arm, &controller.calibration, friction, q, joint)
}

/// Judges what a trial of a drive has led to. `is_last` if no higher bound is left.
pub fn judge(
    joint: &JointParameters,
    breakaway: &Breakaway,
    report: &TrialReport,
    is_last: bool,
) -> Verdict {
    let moved: Vec<_> =
        report.answers.iter().flatten().filter(|answer| answer.counts != 0).collect();
    if moved.iter().any(|answer| (answer.torque > 0) != (answer.counts > 0)) {
        return Verdict::Reversed;
    }
    let torques: Vec<_> = moved.iter().map(|answer| torque(joint, answer)).collect();
    let carries = breakaway.weight.abs() > breakaway.centres.max(breakaway.friction);
    let lifted = torques.iter().find(|torque| **torque * breakaway.weight > 0.0);
    match (lifted, torques.as_slice()) {
        (_, []) => Verdict::Unclear,
        // The other way leads into its rest, which yields or does not.
        (Some(lifted), _) if carries => of_weight(breakaway, lifted.abs()),
        (_, [one, other]) if !carries => of_friction(breakaway, (one - other).abs() / 2.0),
        // It has sunk, or its weight is too small to tell.
        _ if is_last => Verdict::Right,
        _ => Verdict::Unclear,
    }
}

/// Judges the torque that lifts a joint.
fn of_weight(breakaway: &Breakaway, found: f64) -> Verdict {
    let Breakaway { weight, centres, friction, .. } = *breakaway;
    let [[lightest, heaviest], [smoothest, roughest]] = [WEIGHT, FRICTION];
    let described = [
        lightest * (weight.abs() - centres) + smoothest * friction,
        heaviest * (weight.abs() + centres) + roughest * friction,
    ];
    within(Resistance::Weight, found, described)
}

/// Judges the torque that turns a joint without a weight worth the name, both ways.
fn of_friction(breakaway: &Breakaway, found: f64) -> Verdict {
    let Breakaway { weight, centres, friction, .. } = *breakaway;
    let [smoothest, roughest] = FRICTION;
    // Its rest may yield to a push of this many times the weight that nobody has described.
    let yields = YIELDS * (weight.abs() + centres);
    within(Resistance::Friction, found, [smoothest * friction, roughest * friction + yields])
}

fn within(what: Resistance, found: f64, described: [f64; 2]) -> Verdict {
    let [least, most] = described;
    if (least..=most).contains(&found) {
        Verdict::Right
    } else {
        Verdict::OtherTorque { what, found, described }
    }
}

/// Returns the torque of an answer in the direction of its joint, in N·m or N.
pub fn torque(joint: &JointParameters, answer: &TrialAnswer) -> f64 {
    let magnitude = joint.calibration.curve().torque(f64::from(answer.torque));
    magnitude * joint.plant.actuator.gear_ratio.signum()
}

/// Returns the motion of an answer, in rad or m.
pub fn motion(joint: &JointParameters, answer: &TrialAnswer) -> f64 {
    let direction = joint.plant.actuator.gear_ratio.signum();
    f64::from(answer.counts) * joint.calibration.quantum() * direction
}

#[cfg(test)]
mod tests;
