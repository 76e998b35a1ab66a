//! Motions that a person is asked for.

use super::axis::Axis;
use units::numbering::Joint;

/// Motion that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// One joint alone, in the direction in which its position grows.
    Joint(Joint),
    /// The grip along an axis of {0}.
    Push(Axis),
    /// The grip about an axis of {0}, right-handed.
    Turn(Axis),
}

impl Motion {
    /// All motions, in their order.
    pub fn all() -> impl Iterator<Item = Self> {
        let axes = [Axis::X, Axis::Y, Axis::Z];
        let joints = Joint::ALL.into_iter().map(Self::Joint);
        joints.chain(axes.map(Self::Push)).chain(axes.map(Self::Turn))
    }

    /// Returns its name in the file of measurements.
    pub fn name(self) -> String {
        match self {
            Self::Joint(joint) => format!("joint {joint}"),
            Self::Push(axis) => format!("push {axis}"),
            Self::Turn(axis) => format!("turn {axis}"),
        }
    }
}
