//! Conversion between commands and samples of the node and messages of the [`contract`].

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::{Command, RemoteSample};
use contract::{FarEnd, Gripper, Measurements, Order, Pose, Sample};
use units::spatial::{Motion, Twist, Wrench};
use units::time::Instant;

/// Converts a command of the node to an order to the far side.
pub fn order(command: &Command) -> Order {
    let motion = match &command.motion {
        Motion::Hold => contract::Motion::Hold,
        Motion::Rate(v_m) => contract::Motion::Rate(v_m.components()),
        Motion::Pose(x_b_d) => contract::Motion::Pose(pose(x_b_d)),
    };
    Order { motion, is_engaged: command.motion != Motion::Hold, gripper: command.gripper }
}

/// Returns the command of a far side's end at `now`.
pub fn command(end: &mut FarEnd, now: Instant) -> Command {
    let motion = motion(&end.motion(now));
    Command { motion, gripper: end.gripper() }
}

/// Converts the motion of a message to a command to an object.
pub fn motion(motion: &contract::Motion) -> Motion {
    match motion {
        contract::Motion::Hold => Motion::Hold,
        contract::Motion::Rate(v_m) => Motion::Rate(Twist::from_components(*v_m)),
        contract::Motion::Pose(x_b_d) => Motion::Pose(isometry(x_b_d)),
    }
}

/// Converts a sample of an object to a message. Values out of range become invalid.
pub fn measured(sensed: &RemoteSample) -> Measurements {
    let is_possible = sensed.is_possible();
    Measurements {
        wrench: is_possible.then(|| sensed.f_s.components()),
        pose: is_possible.then(|| pose(&sensed.x_b_m)),
        gripper: sensed.gripper.filter(Gripper::is_possible),
    }
}

/// Converts a message to a sample; `None` without a valid wrench and pose.
pub fn sensed(sample: &Sample) -> Option<RemoteSample> {
    let Measurements { wrench, pose, gripper } = sample.feedback.measured;
    let (f_s, x_b_m) = (Wrench::from_components(wrench?), isometry(&pose?));
    Some(RemoteSample { at: sample.at, f_s, x_b_m, gripper })
}

fn pose(x: &Isometry3<f64>) -> Pose {
    Pose { position: x.translation.vector.into(), orientation: x.rotation.coords.into() }
}

fn isometry(&Pose { position, orientation }: &Pose) -> Isometry3<f64> {
    let rotation = UnitQuaternion::new_unchecked(Quaternion::from(orientation));
    Isometry3::from_parts(Translation3::from(position), rotation)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn commands_come_back_from_messages_as_they_were(
            six in prop::array::uniform6(-3.0..3.0_f64), [x, y, z, a, b, c] in prop::array::uniform6(-3.0..3.0_f64),
        ) {
            let x_b_d = Isometry3::new([x, y, z].into(), [a, b, c].into());
            for command in [Motion::Hold, Motion::Rate(Twist::from_components(six)), Motion::Pose(x_b_d)] {
                prop_assert_eq!(motion(&order(&command.into()).motion), command);
            }
        }

        #[test]
        fn only_a_gripper_out_of_range_is_dropped(
            position in prop_oneof![-2e3..2e3_f64, Just(f64::NAN)], force in -2e3..2e3_f64,
        ) {
            let gripper = Gripper { position, force };
            let x_b_m = Isometry3::identity();
            let sensed = RemoteSample { at: Instant::ZERO, f_s: Wrench::ZERO, x_b_m, gripper: Some(gripper) };
            let Measurements { wrench, pose, gripper } = measured(&sensed);
            let is_valid = position.abs() <= 1e3 && force.abs() <= 1e3;
            prop_assert!(wrench.is_some() && pose.is_some());
            prop_assert_eq!(gripper.is_some(), is_valid);
        }
    }
}
